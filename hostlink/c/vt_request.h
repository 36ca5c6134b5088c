/* voronoi-touch: ask a fingertip, set it, tare it; over CANopen SDO and serial lines alike.
 * SPDX-License-Identifier: Apache-2.0
 *
 *     static vt_tare_t tare;
 *
 *     vt_tare_begin(&tare, false);
 *     send(&tare.request);              // below; again where no answer comes within 0.5 s: that is safe
 *     ...
 *     if (vt_tare_answer(&tare, &answer)) {
 *         // over: tare.outcome is one of VT_REST_FRAME_ACCEPTED, _FORCED, _REFUSED, _UNKNOWN
 *     } else {
 *         send(&tare.request);          // the next one; wait 50 ms where tare.wait says so
 *     }
 *
 *     CAN      uint8_t data[8];
 *              vt_request_sdo(&tare.request, data);     to VT_BASE_SDO_REQUEST + node
 *              vt_answer_sdo(&answer, data, size)       from VT_BASE_SDO_RESPONSE + node
 *     serial   uint8_t out[VT_REQUEST_ROOM];
 *              size = vt_request_serial(&tare.request, counter, out, sizeof out)
 *              vt_answer_serial(&answer, &frame)        of frames with type VT_SERIAL_REPLY; counter as asked
 *
 * Objects of up to 4 bytes: all VT_OBJECT_... of vt_e2e.h. Their meanings: WIRE.md, "Objects".
 */
#ifndef VT_REQUEST_H
#define VT_REQUEST_H

#include "vt_serial.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    uint32_t object; /* VT_OBJECT_...: index << 8 | sub-index */
    uint8_t size;    /* bytes to write, 1..4; 0: read */
    uint32_t value;
    uint8_t number;  /* SDO: of a write of 1 to 3 bytes, another one each time, not 0. By it a node tells the same
                      * request sent again from a new one, and does it once. On a serial line the counter serves. */
} vt_request_t;

typedef struct {
    uint32_t object;
    uint32_t abort; /* 0: done; else CiA 301's abort code */
    uint32_t value; /* of a read */
    uint8_t counter; /* serial: the request's */
} vt_answer_t;

#define VT_REQUEST_ROOM VT_SERIAL_WIRE(16u)

void vt_request_sdo(const vt_request_t *request, uint8_t data[8]);
size_t vt_request_serial(const vt_request_t *request, uint8_t counter, uint8_t *out, size_t room);

/* False: damaged, or no answer about an object of up to 4 bytes. */
bool vt_answer_sdo(vt_answer_t *answer, const uint8_t *data, size_t size);
bool vt_answer_serial(vt_answer_t *answer, const vt_frame_t *frame);

typedef struct {
    vt_request_t request; /* to send now */
    bool wait;            /* 50 ms before it is sent: images are being taken */
    uint8_t outcome;      /* VT_REST_FRAME_...; BUSY until it is over */
    uint8_t reason;       /* VT_REASON_..., where it was refused or forced */
    uint32_t abort;       /* not 0: refused at once (0x08000022: something touches the tip) */
    uint16_t number;
    uint8_t step;
} vt_tare_t;

/* Begin; force: take the rest frame even if something touches the tip. */
void vt_tare_begin(vt_tare_t *tare, bool force);

/* Take the answer to tare->request; true: it is over. Answers about other objects change nothing. */
bool vt_tare_answer(vt_tare_t *tare, const vt_answer_t *answer);

#ifdef __cplusplus
}
#endif

#endif
