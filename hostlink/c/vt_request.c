/* voronoi-touch: ask a fingertip, set it, tare it.
 * SPDX-License-Identifier: Apache-2.0
 */
#include "vt_request.h"

/* CiA 301: expedited SDO; bits 2..3 hold the number of bytes without data */
#define SDO_WRITE       0x23u
#define SDO_READ        0x40u
#define SDO_WRITTEN     0x60u
#define SDO_VALUE       0x43u
#define SDO_VALUE_MASK  0xF3u
#define SDO_ABORT       0x80u
#define SDO_SIZE        8u
#define VALUE_MAX       4u

/* WIRE.md, "Serial lines": op 1, index 2, sub 1, offset 4, total 4, data */
#define OP_READ         1u
#define OP_WRITE        2u
#define REQUEST_HEAD    12u
#define REPLY_HEAD      15u /* index 2, sub 1, abort 4, offset 4, total 4 */

#define STEP_WRITE      0u
#define STEP_NUMBER     1u
#define STEP_STATE      2u
#define STEP_REASON     3u
#define STEP_SAME       4u

static void put(uint8_t *data, uint32_t value, size_t size)
{
    uint32_t left = value;

    for (size_t i = 0u; i < size; i++) {
        data[i] = (uint8_t)(left & 0xFFu);
        left >>= 8;
    }
}

static uint32_t get(const uint8_t *data, size_t size)
{
    uint32_t value = 0u;

    for (size_t i = size; i > 0u; i--) {
        value = (value << 8) | data[i - 1u];
    }
    return value;
}

static uint32_t object_at(const uint8_t *data)
{
    return (get(data, 2u) << 8) | data[2];
}

static void put_object(uint8_t *data, uint32_t object)
{
    put(data, object >> 8, 2u);
    put(&data[2], object, 1u);
}

void vt_request_sdo(const vt_request_t *request, uint8_t data[8])
{
    const uint32_t unused = VALUE_MAX - (uint32_t)request->size;

    put(data, (request->size == 0u) ? SDO_READ : (SDO_WRITE | (unused << 2)), 1u);
    put_object(&data[1], request->object);
    put(&data[4], (request->size == 0u) ? 0u : request->value, VALUE_MAX);
    if ((request->size > 0u) && (request->size < VALUE_MAX)) {
        data[SDO_SIZE - 1u] = request->number; /* behind the value, in bytes that hold no data */
    }
}

bool vt_answer_sdo(vt_answer_t *answer, const uint8_t *data, size_t size)
{
    bool known = true;

    if (size != SDO_SIZE) {
        return false;
    }
    answer->object = object_at(&data[1]);
    answer->abort = 0u;
    answer->value = 0u;
    answer->counter = 0u;
    if (data[0] == SDO_ABORT) {
        answer->abort = get(&data[4], VALUE_MAX);
    } else if ((data[0] & SDO_VALUE_MASK) == SDO_VALUE) {
        answer->value = get(&data[4], VALUE_MAX - (((size_t)data[0] >> 2) & 3u));
    } else {
        known = (data[0] == SDO_WRITTEN);
    }
    return known;
}

size_t vt_request_serial(const vt_request_t *request, uint8_t counter, uint8_t *out, size_t room)
{
    uint8_t body[REQUEST_HEAD + VALUE_MAX];

    body[0] = (request->size == 0u) ? OP_READ : OP_WRITE;
    put_object(&body[1], request->object);
    put(&body[4], 0u, 4u);
    put(&body[8], request->size, 4u);
    put(&body[REQUEST_HEAD], request->value, VALUE_MAX);
    return vt_serial_pack(VT_SERIAL_REQUEST, counter, body, REQUEST_HEAD + (size_t)request->size, out, room);
}

bool vt_answer_serial(vt_answer_t *answer, const vt_frame_t *frame)
{
    size_t size = 0u;
    const uint8_t *body = (frame->type == VT_SERIAL_REPLY) ? vt_serial_body(frame, &size) : NULL;

    if ((body == NULL) || (size < REPLY_HEAD) || (size > (REPLY_HEAD + VALUE_MAX))) {
        return false;
    }
    answer->object = object_at(body);
    answer->abort = get(&body[3], 4u);
    answer->value = get(&body[REPLY_HEAD], size - REPLY_HEAD);
    answer->counter = frame->payload[2];
    return true;
}

static void ask(vt_tare_t *tare, uint8_t step, uint32_t object)
{
    tare->step = step;
    tare->wait = false;
    tare->request.object = object;
    tare->request.size = 0u;
    tare->request.value = 0u;
}

void vt_tare_begin(vt_tare_t *tare, bool force)
{
    ask(tare, STEP_WRITE, VT_OBJECT_TARE);
    tare->request.number = (tare->request.number < UINT8_MAX) ? (uint8_t)(tare->request.number + 1u) : 1u;
    tare->request.size = 1u;
    tare->request.value = 1u;
    if (force) {
        tare->request.value = 2u;
    }
    tare->outcome = VT_REST_FRAME_BUSY;
    tare->reason = VT_REASON_NONE;
    tare->abort = 0u;
    tare->number = 0u;
}

static bool is_over(vt_tare_t *tare, uint32_t outcome)
{
    tare->outcome = (uint8_t)outcome;
    return true;
}

/* The number of the request once more: the same, or another host asked since, or the node restarted. */
static bool take_number(vt_tare_t *tare, uint16_t number, uint8_t outcome)
{
    const uint16_t ahead = (uint16_t)((uint32_t)number - tare->number);

    tare->number = number;
    if (ahead == 0u) {
        return is_over(tare, outcome);
    }
    if (ahead > 0x8000u) {
        return is_over(tare, VT_REST_FRAME_UNKNOWN);
    }
    tare->outcome = VT_REST_FRAME_BUSY;
    ask(tare, STEP_STATE, VT_OBJECT_REST_FRAME_STATE);
    return false;
}

bool vt_tare_answer(vt_tare_t *tare, const vt_answer_t *answer)
{
    bool over = false;

    if (answer->object != tare->request.object) {
        return false;
    }
    if (answer->abort != 0u) {
        tare->abort = answer->abort;
        return is_over(tare, (tare->step == STEP_WRITE) ? VT_REST_FRAME_REFUSED : VT_REST_FRAME_UNKNOWN);
    }
    switch (tare->step) {
    case STEP_WRITE:
        ask(tare, STEP_NUMBER, VT_OBJECT_REST_FRAME_REQUEST_N);
        break;
    case STEP_NUMBER:
        tare->number = (uint16_t)(answer->value & 0xFFFFu);
        ask(tare, STEP_STATE, VT_OBJECT_REST_FRAME_STATE);
        break;
    case STEP_STATE:
        tare->outcome = (uint8_t)(answer->value & 0xFFu);
        if (tare->outcome == VT_REST_FRAME_BUSY) {
            tare->wait = true;
        } else if (tare->outcome == VT_REST_FRAME_UNKNOWN) {
            over = true;
        } else {
            ask(tare, STEP_REASON, VT_OBJECT_REST_FRAME_REASON);
        }
        break;
    case STEP_REASON:
        tare->reason = (uint8_t)(answer->value & 0xFFu);
        ask(tare, STEP_SAME, VT_OBJECT_REST_FRAME_REQUEST_N);
        break;
    default:
        over = take_number(tare, (uint16_t)(answer->value & 0xFFFFu), tare->outcome);
        break;
    }
    return over;
}
