/* voronoi-touch: a hand controller's receiver for CAN FD, classic CAN and a serial line. An example to copy from.
 * SPDX-License-Identifier: Apache-2.0
 *
 *     interrupts: on_can(), on_serial_byte()  ->  finger  <-  control loop: finger_pressed_mm(), finger_tare()
 *
 * Link with vt_e2e.c, vt_fd.c and, of the others, those that the link needs: vt_parts.c (classic CAN),
 * vt_serial.c (serial), vt_request.c (tare). No allocation; one finger takes 0.5 kB of RAM with all of them.
 *
 * Yours are three functions: can_send(), serial_send() and the clock that now_ms comes from. One context may
 * run at a time: call these from interrupts of one priority, and mask those in the control loop, before it
 * reads the clock for now_ms.
 */
#include "receiver.h"

#include <math.h>

#include "../vt_fd.h"
#include "../vt_parts.h"
#include "../vt_request.h"

#define STALE_MS 20u /* five samples at 250 Hz */
#define SIGMA_MM 0.2f /* A larger sigma: the calibration does not know this touch. */
#define ASK_MS 500u  /* without an answer: ask again */
#define WAIT_MS 50u  /* while images for a rest frame are taken */

/* One for each finger; all zeros is the start. */
typedef struct {
    vt_order_t order;
    vt_parts_t parts;
    vt_serial_t line;
    vt_tare_t tare;
    uint32_t asked_ms;
    uint8_t counter;
    bool taring;
    float pressed_mm;
    uint32_t heard_ms;
    bool heard;
    uint32_t samples_lost;
} finger_t;

static finger_t finger;

/* A whole, undamaged 64-byte frame, whatever link it came on. Counters of classic CAN run modulo 15. */
static void take_state(const uint8_t *frame, unsigned modulus, uint32_t now_ms)
{
    struct vt_fd_state_t state;
    const int lost = vt_order(&finger.order, frame[2], modulus);

    if ((lost < 0) || (vt_fd_state_unpack(&state, frame, VT_STATE_SIZE) != 0)) {
        return; /* the same frame again */
    }
    finger.samples_lost += (uint32_t)lost;
    finger.pressed_mm = NAN; /* not valid in this sample */
    if (((state.status & VT_STATUS_NO_CONTROL) == 0u) &&
        vt_fd_state_displacement_mm_is_in_range(state.displacement_mm) &&
        vt_fd_state_displacement_sigma_mm_is_in_range(state.displacement_sigma_mm) &&
        (vt_fd_state_displacement_sigma_mm_decode(state.displacement_sigma_mm) < SIGMA_MM)) {
        finger.pressed_mm = vt_fd_state_displacement_mm_decode(state.displacement_mm);
    }
    finger.heard_ms = now_ms;
    finger.heard = true;
}

static void send_request(uint32_t now_ms)
{
    uint8_t out[VT_REQUEST_ROOM];

    finger.asked_ms = now_ms;
#ifdef LINK_SERIAL
    serial_send(out, vt_request_serial(&finger.tare.request, finger.counter, out, sizeof(out)));
#else
    vt_request_sdo(&finger.tare.request, out);
    can_send(VT_BASE_SDO_REQUEST + NODE, out, 8u);
#endif
}

static void take_answer(const vt_answer_t *answer, uint32_t now_ms)
{
    if (finger.taring) {
        finger.taring = !vt_tare_answer(&finger.tare, answer);
        finger.counter++;
        if (finger.taring && !finger.tare.wait) {
            send_request(now_ms);
        }
    }
}

void on_can(uint32_t id, const uint8_t *data, size_t size, uint32_t now_ms)
{
    const uint32_t base = id - NODE;
    /* classic CAN: 0x180, 0x280, 0x380, 0x480 */
    const unsigned tpdo = ((base & 0xFFu) == 0x80u) ? (unsigned)(base >> 8) : 0u;
    vt_answer_t answer;

    if (base == VT_BASE_SDO_RESPONSE) {
        if (vt_answer_sdo(&answer, data, size)) {
            take_answer(&answer, now_ms);
        }
    } else if ((size == VT_PART_SIZE) && (tpdo >= 1u) && (tpdo <= 4u)) {
        if (vt_parts_add(&finger.parts, tpdo, data, size)) {
            take_state(finger.parts.frame, 15u, now_ms);
        }
    } else if ((base == VT_BASE_STATE) && vt_check_state(data, size)) {
        take_state(data, 256u, now_ms);
    } else {
        /* damaged, of another version or another's */
    }
}

void on_serial_byte(uint8_t byte, uint32_t now_ms)
{
    vt_frame_t frame;
    vt_answer_t answer;

    if (vt_serial_take(&finger.line, byte, &frame)) {
        if (frame.type == VT_SERIAL_STATE) {
            if (vt_check_state(frame.payload, frame.size)) {
                take_state(frame.payload, 256u, now_ms);
            }
        } else if (vt_answer_serial(&answer, &frame) && (answer.counter == finger.counter)) {
            take_answer(&answer, now_ms);
        } else {
            /* heartbeat, emergency, detail: not looked at here */
        }
    }
}

void finger_tare(uint32_t now_ms)
{
    vt_tare_begin(&finger.tare, false);
    finger.taring = true;
    finger.counter++;
    send_request(now_ms);
}

uint8_t finger_tare_outcome(uint32_t now_ms)
{
    if (finger.taring && ((now_ms - finger.asked_ms) > (finger.tare.wait ? WAIT_MS : ASK_MS))) {
        send_request(now_ms);
    }
    return finger.tare.outcome;
}

float finger_pressed_mm(uint32_t now_ms)
{
    /* A queue may stamp a frame later than the loop read its clock. */
    const uint32_t age_ms = (now_ms - finger.heard_ms) + STALE_MS;

    return (finger.heard && (age_ms <= (2u * STALE_MS))) ? finger.pressed_mm : NAN;
}

uint32_t finger_samples_lost(void)
{
    return finger.samples_lost;
}
