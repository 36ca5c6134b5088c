/* voronoi-touch: the parts of a sample on classic CAN, put together.
 * SPDX-License-Identifier: Apache-2.0
 */
#include "vt_parts.h"

#include "vt_parts_fields.h"

#define HEADER_P11 2u
#define COUNTER_MASK 0x0Fu

static uint32_t bits_set(uint32_t value)
{
    uint32_t left = value;
    uint32_t count = 0u;

    while (left != 0u) {
        count += left & 1u;
        left >>= 1;
    }
    return count;
}

static void begin(vt_parts_t *parts, uint8_t counter, uint8_t sample_low)
{
    for (size_t i = 0u; i < sizeof(parts->frame); i++) {
        parts->frame[i] = 0u;
    }
    for (size_t i = 0u; i < VT_UNKNOWN_N; i++) {
        parts->frame[4u + i] = vt_unknown[i];
    }
    parts->counter = counter;
    parts->sample_low = sample_low;
    parts->taken = 0u;
}

static void drop(vt_parts_t *parts)
{
    if (parts->taken != 0u) {
        parts->taken = 0u;
        parts->dropped_n++;
    }
}

/* A field as the 64-byte frame has it: wider, so its sign and its "invalid" are made wider too. */
static uint32_t widen(const vt_part_field_t *field, uint32_t raw)
{
    const uint32_t top = (uint32_t)1u << (field->bits - 1u);
    const uint32_t all = top | (top - 1u);
    const uint32_t wide_top = (uint32_t)1u << ((8u * field->size) - 1u);
    uint32_t value = raw;

    if (field->kind == VT_SIGNED) {
        if (raw == top) {
            value = wide_top;
        } else if ((raw & top) != 0u) {
            value = raw | ~all;
        } else {
            /* not negative: as it is */
        }
    } else if ((field->kind == VT_UNSIGNED) && (raw == all)) {
        value = wide_top | (wide_top - 1u);
    } else {
        /* as it is */
    }
    return value;
}

static void take_fields(vt_parts_t *parts, unsigned index, uint64_t payload)
{
    for (size_t i = 0u; i < VT_FIELD_N; i++) {
        const vt_part_field_t *field = &vt_part_fields[i];

        if (field->part == index) {
            const uint64_t mask = ((uint64_t)1u << field->bits) - 1u;
            uint32_t value = widen(field, (uint32_t)((payload >> field->shift) & mask));

            for (size_t k = 0u; k < field->size; k++) {
                parts->frame[(size_t)field->at + k] = (uint8_t)(value & 0xFFu);
                value >>= 8;
            }
        }
    }
}

/* Make the frame whole: version, sample number, check, E2E header. */
static bool finish(vt_parts_t *parts)
{
    uint8_t *frame = parts->frame;
    const uint32_t high = frame[VT_AT_SAMPLE_HIGH] | ((uint32_t)frame[VT_AT_SAMPLE_HIGH + 1u] << 8);
    const uint32_t sample = (high << VT_SAMPLE_LOW_BITS) | parts->sample_low;
    uint32_t check;

    frame[3] = VT_VERSION;
    frame[VT_AT_SAMPLE] = (uint8_t)(sample & 0xFFu);
    frame[VT_AT_SAMPLE + 1u] = (uint8_t)((sample >> 8) & 0xFFu);
    check = vt_crc32(&frame[3], VT_STATE_SIZE - 5u);
    if (((parts->taken & VT_PARTS_ALWAYS) != VT_PARTS_ALWAYS) || ((check & 0xFFu) != frame[VT_AT_CHECK])) {
        drop(parts);
        return false;
    }
    frame[VT_STATE_SIZE - 2u] = (uint8_t)(check & 0xFFu);
    frame[VT_STATE_SIZE - 1u] = (uint8_t)((check >> 8) & 0xFFu);
    vt_protect_p5(frame, VT_STATE_SIZE, parts->counter, VT_DATA_ID_STATE);
    parts->taken = 0u;
    return true;
}

bool vt_parts_add(vt_parts_t *parts, unsigned tpdo, const uint8_t *data, size_t size)
{
    const int found = (size == VT_PART_SIZE) ? vt_part_index(tpdo, data) : -1;
    const unsigned index = (unsigned)found;
    uint64_t payload = 0u;
    uint8_t counter;
    uint8_t sample_low;

    if ((found < 0) || !vt_check_p11(data, size, (uint16_t)(VT_DATA_ID_PART | index))) {
        parts->damaged_n++;
        return false;
    }
    for (size_t i = VT_PART_SIZE; i > HEADER_P11; i--) {
        payload = (payload << 8) | data[i - 1u];
    }
    counter = data[1] & COUNTER_MASK;
    sample_low = (uint8_t)(payload & (((uint64_t)1u << VT_SAMPLE_LOW_BITS) - 1u));
    if (index == 0u) {
        drop(parts);
        begin(parts, counter, sample_low);
    } else if ((parts->taken == 0u) || (counter != parts->counter) || (sample_low != parts->sample_low) ||
               ((parts->taken >> index) != 0u)) {
        drop(parts); /* another sample's, or out of order */
        return false;
    } else {
        /* the next part of the sample begun */
    }
    parts->taken = (uint16_t)(parts->taken | (1u << index));
    take_fields(parts, index, payload);
    return (bits_set(parts->taken) == parts->frame[VT_AT_PART_N]) && finish(parts);
}
