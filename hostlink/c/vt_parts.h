/* voronoi-touch: the parts of a sample on classic CAN, put together.
 * SPDX-License-Identifier: Apache-2.0
 *
 *     static vt_parts_t parts;                                     // one for each fingertip, zeros at first
 *
 *     if (vt_parts_add(&parts, tpdo, data, size)) {                // tpdo: 1..4, from the identifier
 *         take(parts.frame);                                       // as on CAN FD, VT_STATE_SIZE bytes
 *     }
 *
 * The result is the frame that CAN FD carries: vt_check_state holds, vt_fd_state_unpack reads it. Its
 * counter is the parts': vt_order(&order, frame[2], 15u).
 *
 * Two samples never mix: counter and lower sample number must agree in all parts, parts count up, and the
 * check of the whole must hold. A lost part is a lost sample.
 */
#ifndef VT_PARTS_H
#define VT_PARTS_H

#include "vt_e2e.h"

#ifdef __cplusplus
extern "C" {
#endif

#define VT_PART_SIZE 8u

typedef struct {
    uint8_t frame[VT_STATE_SIZE + 4u]; /* the frame, and behind it what only the parts have */
    uint16_t taken;                    /* bit i: part i of the sample begun; 0: none is */
    uint8_t counter;
    uint8_t sample_low;
    uint32_t dropped_n; /* samples begun that never were complete, or did not fit together */
    uint32_t damaged_n; /* parts with a wrong CRC, page or length, or of another version */
} vt_parts_t;

/* Take one message; true: `frame` is a whole sample, until the next call. */
bool vt_parts_add(vt_parts_t *parts, unsigned tpdo, const uint8_t *data, size_t size);

#ifdef __cplusplus
}
#endif

#endif
