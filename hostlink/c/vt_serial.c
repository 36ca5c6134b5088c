/* voronoi-touch: frames on a serial line.
 * SPDX-License-Identifier: Apache-2.0
 */
#include "vt_serial.h"

#define RUN_MAX 254u /* bytes without a zero in one COBS block */
#define CRC_SIZE 4u

/* Decode in place; the number of bytes, 0 if a block runs past the end. */
static size_t cobs_decode(uint8_t *data, size_t size)
{
    size_t from = 0u;
    size_t to = 0u;

    while (from < size) {
        const size_t code = data[from];
        const size_t end = from + code;

        if (end > size) {
            return 0u;
        }
        from++;
        while (from < end) {
            data[to] = data[from];
            to++;
            from++;
        }
        if ((code <= RUN_MAX) && (from < size)) {
            data[to] = 0u;
            to++;
        }
    }
    return to;
}

static uint32_t get32(const uint8_t *data)
{
    return data[0] | ((uint32_t)data[1] << 8) | ((uint32_t)data[2] << 16) | ((uint32_t)data[3] << 24);
}

/* A whole block is there: what is in it, if it is undamaged. */
static bool unpack(uint8_t *block, size_t block_size, vt_frame_t *frame)
{
    const size_t size = cobs_decode(block, block_size);

    if (size < (1u + VT_SERIAL_HEADER + CRC_SIZE)) {
        return false;
    }
    if (vt_crc32(block, size - CRC_SIZE) != get32(&block[size - CRC_SIZE])) {
        return false;
    }
    frame->type = block[0];
    frame->payload = &block[1];
    frame->size = size - 1u - CRC_SIZE;
    return true;
}

bool vt_serial_take(vt_serial_t *line, uint8_t byte, vt_frame_t *frame)
{
    bool whole = false;

    if (byte != 0u) {
        if (line->size < VT_SERIAL_BLOCK_MAX) {
            line->block[line->size] = byte;
            line->size++;
        } else {
            line->too_long = true;
        }
    } else {
        if ((line->size > 0u) && !line->too_long) {
            whole = unpack(line->block, line->size, frame);
        }
        if ((line->size > 0u) && !whole && line->in_step) {
            line->damaged_n++;
        }
        line->size = 0u;
        line->too_long = false;
        line->in_step = true;
    }
    return whole;
}

static uint16_t data_id(uint8_t type)
{
    return (uint16_t)((VT_DATA_ID_STATE + (uint32_t)type) & 0xFFFFu);
}

const uint8_t *vt_serial_body(const vt_frame_t *frame, size_t *size)
{
    if (!vt_check_p5(frame->payload, frame->size, data_id(frame->type))) {
        return NULL;
    }
    *size = frame->size - VT_SERIAL_HEADER;
    return &frame->payload[VT_SERIAL_HEADER];
}

/* Write COBS and the zeros around it; the room is known to do. */
static size_t cobs_encode(const uint8_t *data, size_t size, uint8_t *out)
{
    size_t code_at = 1u;
    size_t to = 2u;
    uint8_t code = 1u;

    out[0] = 0u;
    for (size_t i = 0u; i < size; i++) {
        if (data[i] != 0u) {
            out[to] = data[i];
            to++;
            code++;
        }
        if ((data[i] == 0u) || ((code == (RUN_MAX + 1u)) && ((i + 1u) < size))) {
            out[code_at] = code;
            code_at = to;
            to++;
            code = 1u;
        }
    }
    out[code_at] = code;
    out[to] = 0u;
    return to + 1u;
}

size_t vt_serial_pack(uint8_t type, uint8_t counter, const uint8_t *body, size_t size, uint8_t *out, size_t room)
{
    uint8_t frame[VT_SERIAL_FRAME_MAX];
    const size_t payload_size = VT_SERIAL_HEADER + size;
    uint32_t crc;

    if ((size > VT_SERIAL_BODY_MAX) || (room < VT_SERIAL_WIRE(size))) {
        return 0u;
    }
    frame[0] = type;
    frame[VT_SERIAL_HEADER] = VT_VERSION;
    for (size_t i = 0u; i < size; i++) {
        frame[1u + VT_SERIAL_HEADER + i] = body[i];
    }
    vt_protect_p5(&frame[1], payload_size, counter, data_id(type));
    crc = vt_crc32(frame, 1u + payload_size);
    for (size_t i = 0u; i < CRC_SIZE; i++) {
        frame[1u + payload_size + i] = (uint8_t)(crc & 0xFFu);
        crc >>= 8;
    }
    return cobs_encode(frame, 1u + payload_size + CRC_SIZE, out);
}
