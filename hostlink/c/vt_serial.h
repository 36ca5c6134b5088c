/* voronoi-touch: frames on a serial line. COBS blocks between zeros, CRC-32; what is in them is as on CAN FD.
 * SPDX-License-Identifier: Apache-2.0
 *
 *     static vt_serial_t line;                                     // zeros at first
 *     vt_frame_t frame;
 *
 *     if (vt_serial_take(&line, byte, &frame) && frame.type == VT_SERIAL_STATE) {
 *         take(frame.payload, frame.size);                         // valid until the next byte
 *     }
 *
 * One call a byte, a few instructions each; the one that ends a frame checks and unpacks it (in place).
 */
#ifndef VT_SERIAL_H
#define VT_SERIAL_H

#include "vt_e2e.h"

#ifdef __cplusplus
extern "C" {
#endif

#define VT_SERIAL_STATE     0u
#define VT_SERIAL_DETAIL    1u
#define VT_SERIAL_REQUEST   2u
#define VT_SERIAL_REPLY     3u
#define VT_SERIAL_HEARTBEAT 4u
#define VT_SERIAL_EMERGENCY 5u
#define VT_SERIAL_NMT       6u
#define VT_SERIAL_SYNC      7u

#define VT_SERIAL_HEADER    4u   /* of a payload: E2E profile 5 and version */
#define VT_SERIAL_BODY_MAX  255u
#define VT_SERIAL_FRAME_MAX (1u + VT_SERIAL_HEADER + VT_SERIAL_BODY_MAX + 4u) /* type, payload, CRC-32 */
#define VT_SERIAL_BLOCK_MAX (VT_SERIAL_FRAME_MAX + 2u)                        /* COBS adds 2 at the most */
#define VT_SERIAL_WIRE(body) (1u + VT_SERIAL_HEADER + (body) + 4u + 4u)       /* room for vt_serial_pack */

typedef struct {
    uint8_t block[VT_SERIAL_BLOCK_MAX];
    size_t size;
    bool in_step;  /* a zero was seen: what comes before the first is half a frame */
    bool too_long; /* wait for its end */
    uint32_t damaged_n;
} vt_serial_t;

typedef struct {
    uint8_t type;
    const uint8_t *payload; /* E2E header (4 bytes) and body */
    size_t size;
} vt_frame_t;

/* Take one byte; true: `frame` is whole, its CRC-32 right. A payload's own E2E check is still to be made:
 * vt_check_state for a state, vt_serial_body for the others. */
bool vt_serial_take(vt_serial_t *line, uint8_t byte, vt_frame_t *frame);

/* Body of a frame that is no state or detail; NULL: its E2E check is wrong. Its counter is payload[2]. */
const uint8_t *vt_serial_body(const vt_frame_t *frame, size_t *size);

/* The bytes to send for a body; their number, 0 if there is not room enough (VT_SERIAL_WIRE(size)). */
size_t vt_serial_pack(uint8_t type, uint8_t counter, const uint8_t *body, size_t size, uint8_t *out, size_t room);

#ifdef __cplusplus
}
#endif

#endif
