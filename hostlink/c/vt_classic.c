/**
 * @file vt_classic.c
 *
 *
 * @copyright Copyright (c) 2018-2019 Erik Moqvist
 *
 * @par License
 * The MIT License (MIT)
 *
 * Permission is hereby granted, free of charge, to any person
 * obtaining a copy of this software and associated documentation
 * files (the "Software"), to deal in the Software without
 * restriction, including without limitation the rights to use, copy,
 * modify, merge, publish, distribute, sublicense, and/or sell copies
 * of the Software, and to permit persons to whom the Software is
 * furnished to do so, subject to the following conditions:
 *
 * The above copyright notice and this permission notice shall be
 * included in all copies or substantial portions of the Software.
 *
 * THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND,
 * EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF
 * MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND
 * NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS
 * BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN
 * ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN
 * CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE
 * SOFTWARE.
 */

#include <math.h>
#include <string.h>

#include "vt_classic.h"

static inline uint8_t pack_left_shift_u8(
    uint8_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint8_t)((uint8_t)(value << shift) & mask);
}

static inline uint8_t pack_left_shift_u16(
    uint16_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint8_t)((uint8_t)(value << shift) & mask);
}

static inline uint8_t pack_left_shift_u32(
    uint32_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint8_t)((uint8_t)(value << shift) & mask);
}

static inline uint8_t pack_right_shift_u16(
    uint16_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint8_t)((uint8_t)(value >> shift) & mask);
}

static inline uint8_t pack_right_shift_u32(
    uint32_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint8_t)((uint8_t)(value >> shift) & mask);
}

static inline uint16_t unpack_left_shift_u16(
    uint8_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint16_t)((uint16_t)(value & mask) << shift);
}

static inline uint32_t unpack_left_shift_u32(
    uint8_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint32_t)((uint32_t)(value & mask) << shift);
}

static inline uint8_t unpack_right_shift_u8(
    uint8_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint8_t)((uint8_t)(value & mask) >> shift);
}

static inline uint16_t unpack_right_shift_u16(
    uint8_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint16_t)((uint16_t)(value & mask) >> shift);
}

static inline uint32_t unpack_right_shift_u32(
    uint8_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint32_t)((uint32_t)(value & mask) >> shift);
}

static uint64_t cantools_unsigned_from_double(double value)
{
    if (value < 0) {
        return 0;
    }

    return (uint64_t)value;
}

int vt_classic_part1_pack(
    uint8_t *dst_p,
    const struct vt_classic_part1_t *src_p,
    size_t size)
{
    uint16_t displacement_mm;
    uint16_t shear_x_mm;
    uint16_t shear_y_mm;

    if (size < 8u) {
        return (-EINVAL);
    }

    memset(&dst_p[0], 0, 8);

    dst_p[0] |= pack_left_shift_u8(src_p->crc, 0u, 0xffu);
    dst_p[1] |= pack_left_shift_u8(src_p->counter, 0u, 0x0fu);
    dst_p[1] |= pack_left_shift_u8(src_p->version, 4u, 0xf0u);
    dst_p[2] |= pack_left_shift_u8(src_p->sample_low, 0u, 0x1fu);
    displacement_mm = (uint16_t)src_p->displacement_mm;
    dst_p[2] |= pack_left_shift_u16(displacement_mm, 5u, 0xe0u);
    dst_p[3] |= pack_right_shift_u16(displacement_mm, 3u, 0xffu);
    dst_p[4] |= pack_right_shift_u16(displacement_mm, 11u, 0x07u);
    shear_x_mm = (uint16_t)src_p->shear_x_mm;
    dst_p[4] |= pack_left_shift_u16(shear_x_mm, 3u, 0xf8u);
    dst_p[5] |= pack_right_shift_u16(shear_x_mm, 5u, 0xffu);
    dst_p[6] |= pack_right_shift_u16(shear_x_mm, 13u, 0x01u);
    shear_y_mm = (uint16_t)src_p->shear_y_mm;
    dst_p[6] |= pack_left_shift_u16(shear_y_mm, 1u, 0xfeu);
    dst_p[7] |= pack_right_shift_u16(shear_y_mm, 7u, 0x7fu);

    return (8);
}

int vt_classic_part1_unpack(
    struct vt_classic_part1_t *dst_p,
    const uint8_t *src_p,
    size_t size)
{
    uint16_t displacement_mm;
    uint16_t shear_x_mm;
    uint16_t shear_y_mm;

    if (size < 8u) {
        return (-EINVAL);
    }

    dst_p->crc = unpack_right_shift_u8(src_p[0], 0u, 0xffu);
    dst_p->counter = unpack_right_shift_u8(src_p[1], 0u, 0x0fu);
    dst_p->version = unpack_right_shift_u8(src_p[1], 4u, 0xf0u);
    dst_p->sample_low = unpack_right_shift_u8(src_p[2], 0u, 0x1fu);
    displacement_mm = unpack_right_shift_u16(src_p[2], 5u, 0xe0u);
    displacement_mm |= unpack_left_shift_u16(src_p[3], 3u, 0xffu);
    displacement_mm |= unpack_left_shift_u16(src_p[4], 11u, 0x07u);

    if ((displacement_mm & (1u << 13)) != 0u) {
        displacement_mm |= 0xc000u;
    }

    dst_p->displacement_mm = (int16_t)displacement_mm;
    shear_x_mm = unpack_right_shift_u16(src_p[4], 3u, 0xf8u);
    shear_x_mm |= unpack_left_shift_u16(src_p[5], 5u, 0xffu);
    shear_x_mm |= unpack_left_shift_u16(src_p[6], 13u, 0x01u);

    if ((shear_x_mm & (1u << 13)) != 0u) {
        shear_x_mm |= 0xc000u;
    }

    dst_p->shear_x_mm = (int16_t)shear_x_mm;
    shear_y_mm = unpack_right_shift_u16(src_p[6], 1u, 0xfeu);
    shear_y_mm |= unpack_left_shift_u16(src_p[7], 7u, 0x7fu);

    if ((shear_y_mm & (1u << 13)) != 0u) {
        shear_y_mm |= 0xc000u;
    }

    dst_p->shear_y_mm = (int16_t)shear_y_mm;

    return (0);
}

int vt_classic_part1_init(struct vt_classic_part1_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_classic_part1_t));

    return 0;
}

uint8_t vt_classic_part1_crc_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part1_crc_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part1_crc_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_part1_crc_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint8_t vt_classic_part1_counter_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part1_counter_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part1_counter_is_in_range(uint8_t value)
{
    return (value <= 14u);
}

bool vt_classic_part1_counter_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 14.0f));
}

uint8_t vt_classic_part1_version_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part1_version_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part1_version_is_in_range(uint8_t value)
{
    return (value <= 15u);
}

bool vt_classic_part1_version_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 15.0f));
}

uint8_t vt_classic_part1_sample_low_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part1_sample_low_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part1_sample_low_is_in_range(uint8_t value)
{
    return (value <= 31u);
}

bool vt_classic_part1_sample_low_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 31.0f));
}

int16_t vt_classic_part1_displacement_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part1_displacement_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part1_displacement_mm_is_in_range(int16_t value)
{
    return ((value >= -8000) && (value <= 8000));
}

bool vt_classic_part1_displacement_mm_is_in_phys_range(float value)
{
    return ((value >= -16.0f) && (value <= 16.0f));
}

int16_t vt_classic_part1_shear_x_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part1_shear_x_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part1_shear_x_mm_is_in_range(int16_t value)
{
    return ((value >= -8000) && (value <= 8000));
}

bool vt_classic_part1_shear_x_mm_is_in_phys_range(float value)
{
    return ((value >= -16.0f) && (value <= 16.0f));
}

int16_t vt_classic_part1_shear_y_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part1_shear_y_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part1_shear_y_mm_is_in_range(int16_t value)
{
    return ((value >= -8000) && (value <= 8000));
}

bool vt_classic_part1_shear_y_mm_is_in_phys_range(float value)
{
    return ((value >= -16.0f) && (value <= 16.0f));
}

int vt_classic_part2_pack(
    uint8_t *dst_p,
    const struct vt_classic_part2_t *src_p,
    size_t size)
{
    if (size < 8u) {
        return (-EINVAL);
    }

    memset(&dst_p[0], 0, 8);

    dst_p[0] |= pack_left_shift_u8(src_p->crc, 0u, 0xffu);
    dst_p[1] |= pack_left_shift_u8(src_p->counter, 0u, 0x0fu);
    dst_p[1] |= pack_left_shift_u8(src_p->version, 4u, 0xf0u);
    dst_p[2] |= pack_left_shift_u8(src_p->sample_low, 0u, 0x1fu);
    dst_p[2] |= pack_left_shift_u16(src_p->status, 5u, 0xe0u);
    dst_p[3] |= pack_right_shift_u16(src_p->status, 3u, 0xffu);
    dst_p[4] |= pack_right_shift_u16(src_p->status, 11u, 0x1fu);
    dst_p[4] |= pack_left_shift_u16(src_p->sample_high, 5u, 0xe0u);
    dst_p[5] |= pack_right_shift_u16(src_p->sample_high, 3u, 0xffu);
    dst_p[6] |= pack_left_shift_u8(src_p->pins_tracked, 0u, 0xffu);
    dst_p[7] |= pack_left_shift_u8(src_p->contact_n, 0u, 0x0fu);
    dst_p[7] |= pack_left_shift_u8(src_p->part_n, 4u, 0xf0u);

    return (8);
}

int vt_classic_part2_unpack(
    struct vt_classic_part2_t *dst_p,
    const uint8_t *src_p,
    size_t size)
{
    if (size < 8u) {
        return (-EINVAL);
    }

    dst_p->crc = unpack_right_shift_u8(src_p[0], 0u, 0xffu);
    dst_p->counter = unpack_right_shift_u8(src_p[1], 0u, 0x0fu);
    dst_p->version = unpack_right_shift_u8(src_p[1], 4u, 0xf0u);
    dst_p->sample_low = unpack_right_shift_u8(src_p[2], 0u, 0x1fu);
    dst_p->status = unpack_right_shift_u16(src_p[2], 5u, 0xe0u);
    dst_p->status |= unpack_left_shift_u16(src_p[3], 3u, 0xffu);
    dst_p->status |= unpack_left_shift_u16(src_p[4], 11u, 0x1fu);
    dst_p->sample_high = unpack_right_shift_u16(src_p[4], 5u, 0xe0u);
    dst_p->sample_high |= unpack_left_shift_u16(src_p[5], 3u, 0xffu);
    dst_p->pins_tracked = unpack_right_shift_u8(src_p[6], 0u, 0xffu);
    dst_p->contact_n = unpack_right_shift_u8(src_p[7], 0u, 0x0fu);
    dst_p->part_n = unpack_right_shift_u8(src_p[7], 4u, 0xf0u);

    return (0);
}

int vt_classic_part2_init(struct vt_classic_part2_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_classic_part2_t));

    return 0;
}

uint8_t vt_classic_part2_crc_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part2_crc_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part2_crc_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_part2_crc_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint8_t vt_classic_part2_counter_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part2_counter_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part2_counter_is_in_range(uint8_t value)
{
    return (value <= 14u);
}

bool vt_classic_part2_counter_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 14.0f));
}

uint8_t vt_classic_part2_version_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part2_version_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part2_version_is_in_range(uint8_t value)
{
    return (value <= 15u);
}

bool vt_classic_part2_version_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 15.0f));
}

uint8_t vt_classic_part2_sample_low_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part2_sample_low_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part2_sample_low_is_in_range(uint8_t value)
{
    return (value <= 31u);
}

bool vt_classic_part2_sample_low_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 31.0f));
}

uint16_t vt_classic_part2_status_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part2_status_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_classic_part2_status_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_part2_status_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

uint16_t vt_classic_part2_sample_high_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part2_sample_high_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_classic_part2_sample_high_is_in_range(uint16_t value)
{
    return (value <= 2047u);
}

bool vt_classic_part2_sample_high_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 2047.0f));
}

uint8_t vt_classic_part2_pins_tracked_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.004f)));
}

float vt_classic_part2_pins_tracked_decode(uint8_t value)
{
    return ((float)value * 0.004f);
}

bool vt_classic_part2_pins_tracked_is_in_range(uint8_t value)
{
    return (value <= 250u);
}

bool vt_classic_part2_pins_tracked_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1.0f));
}

uint8_t vt_classic_part2_contact_n_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part2_contact_n_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part2_contact_n_is_in_range(uint8_t value)
{
    return (value <= 14u);
}

bool vt_classic_part2_contact_n_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 14.0f));
}

uint8_t vt_classic_part2_part_n_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part2_part_n_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part2_part_n_is_in_range(uint8_t value)
{
    return (value <= 15u);
}

bool vt_classic_part2_part_n_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 15.0f));
}

int vt_classic_part3_pack(
    uint8_t *dst_p,
    const struct vt_classic_part3_t *src_p,
    size_t size)
{
    uint16_t force_n;
    uint16_t force_x_n;
    uint16_t force_y_n;
    uint16_t pressure_kpa;
    uint16_t tilt_x_deg;
    uint16_t tilt_y_deg;
    uint16_t torque_z_nmm;
    uint16_t torsion_deg;
    uint8_t orientation_deg;
    uint8_t temperature_degc;

    if (size < 8u) {
        return (-EINVAL);
    }

    memset(&dst_p[0], 0, 8);

    dst_p[0] |= pack_left_shift_u8(src_p->crc, 0u, 0xffu);
    dst_p[1] |= pack_left_shift_u8(src_p->counter, 0u, 0x0fu);
    dst_p[1] |= pack_left_shift_u8(src_p->version, 4u, 0xf0u);
    dst_p[2] |= pack_left_shift_u8(src_p->sample_low, 0u, 0x1fu);
    dst_p[2] |= pack_left_shift_u8(src_p->page, 5u, 0xe0u);

    switch (src_p->page) {

    case 0:
        dst_p[3] |= pack_left_shift_u32(src_p->capture_time_us, 0u, 0xffu);
        dst_p[4] |= pack_right_shift_u32(src_p->capture_time_us, 8u, 0xffu);
        dst_p[5] |= pack_right_shift_u32(src_p->capture_time_us, 16u, 0xffu);
        dst_p[6] |= pack_right_shift_u32(src_p->capture_time_us, 24u, 0xffu);
        dst_p[7] |= pack_left_shift_u8(src_p->check, 0u, 0xffu);
        break;

    case 1:
        dst_p[3] |= pack_left_shift_u8(src_p->displacement_sigma_mm, 0u, 0xffu);
        dst_p[4] |= pack_left_shift_u8(src_p->shear_sigma_mm, 0u, 0xffu);
        dst_p[5] |= pack_left_shift_u16(src_p->latency_us, 0u, 0xffu);
        dst_p[6] |= pack_right_shift_u16(src_p->latency_us, 8u, 0xffu);
        temperature_degc = (uint8_t)src_p->temperature_degc;
        dst_p[7] |= pack_left_shift_u8(temperature_degc, 0u, 0xffu);
        break;

    case 2:
        force_n = (uint16_t)src_p->force_n;
        dst_p[3] |= pack_left_shift_u16(force_n, 0u, 0xffu);
        dst_p[4] |= pack_right_shift_u16(force_n, 8u, 0xffu);
        pressure_kpa = (uint16_t)src_p->pressure_kpa;
        dst_p[5] |= pack_left_shift_u16(pressure_kpa, 0u, 0xffu);
        dst_p[6] |= pack_right_shift_u16(pressure_kpa, 8u, 0xffu);
        break;

    case 3:
        dst_p[3] |= pack_left_shift_u16(src_p->contact_area_mm2, 0u, 0xffu);
        dst_p[4] |= pack_right_shift_u16(src_p->contact_area_mm2, 8u, 0xffu);
        orientation_deg = (uint8_t)src_p->orientation_deg;
        dst_p[5] |= pack_left_shift_u8(orientation_deg, 0u, 0xffu);
        dst_p[6] |= pack_left_shift_u8(src_p->vibration_mm, 0u, 0xffu);
        break;

    case 4:
        tilt_x_deg = (uint16_t)src_p->tilt_x_deg;
        dst_p[3] |= pack_left_shift_u16(tilt_x_deg, 0u, 0xffu);
        dst_p[4] |= pack_right_shift_u16(tilt_x_deg, 8u, 0xffu);
        tilt_y_deg = (uint16_t)src_p->tilt_y_deg;
        dst_p[5] |= pack_left_shift_u16(tilt_y_deg, 0u, 0xffu);
        dst_p[6] |= pack_right_shift_u16(tilt_y_deg, 8u, 0xffu);
        break;

    case 5:
        torsion_deg = (uint16_t)src_p->torsion_deg;
        dst_p[3] |= pack_left_shift_u16(torsion_deg, 0u, 0xffu);
        dst_p[4] |= pack_right_shift_u16(torsion_deg, 8u, 0xffu);
        dst_p[5] |= pack_left_shift_u8(src_p->slip_speed_mm_s, 0u, 0xffu);
        dst_p[6] |= pack_left_shift_u8(src_p->slip_probability, 0u, 0xffu);
        dst_p[7] |= pack_left_shift_u8(src_p->twist_slip_probability, 0u, 0xffu);
        break;

    case 6:
        force_x_n = (uint16_t)src_p->force_x_n;
        dst_p[3] |= pack_left_shift_u16(force_x_n, 0u, 0xffu);
        dst_p[4] |= pack_right_shift_u16(force_x_n, 8u, 0xffu);
        force_y_n = (uint16_t)src_p->force_y_n;
        dst_p[5] |= pack_left_shift_u16(force_y_n, 0u, 0xffu);
        dst_p[6] |= pack_right_shift_u16(force_y_n, 8u, 0xffu);
        dst_p[7] |= pack_left_shift_u8(src_p->force_xy_sigma_n, 0u, 0xffu);
        break;

    case 7:
        torque_z_nmm = (uint16_t)src_p->torque_z_nmm;
        dst_p[3] |= pack_left_shift_u16(torque_z_nmm, 0u, 0xffu);
        dst_p[4] |= pack_right_shift_u16(torque_z_nmm, 8u, 0xffu);
        dst_p[5] |= pack_left_shift_u8(src_p->torque_z_sigma_nmm, 0u, 0xffu);
        dst_p[6] |= pack_left_shift_u8(src_p->friction, 0u, 0xffu);
        dst_p[7] |= pack_left_shift_u8(src_p->slip_margin, 0u, 0xffu);
        break;

    default:
        break;
    }

    return (8);
}

int vt_classic_part3_unpack(
    struct vt_classic_part3_t *dst_p,
    const uint8_t *src_p,
    size_t size)
{
    uint16_t force_n;
    uint16_t force_x_n;
    uint16_t force_y_n;
    uint16_t pressure_kpa;
    uint16_t tilt_x_deg;
    uint16_t tilt_y_deg;
    uint16_t torque_z_nmm;
    uint16_t torsion_deg;
    uint8_t orientation_deg;
    uint8_t temperature_degc;

    if (size < 8u) {
        return (-EINVAL);
    }

    dst_p->crc = unpack_right_shift_u8(src_p[0], 0u, 0xffu);
    dst_p->counter = unpack_right_shift_u8(src_p[1], 0u, 0x0fu);
    dst_p->version = unpack_right_shift_u8(src_p[1], 4u, 0xf0u);
    dst_p->sample_low = unpack_right_shift_u8(src_p[2], 0u, 0x1fu);
    dst_p->page = unpack_right_shift_u8(src_p[2], 5u, 0xe0u);

    switch (dst_p->page) {

    case 0:
        dst_p->capture_time_us = unpack_right_shift_u32(src_p[3], 0u, 0xffu);
        dst_p->capture_time_us |= unpack_left_shift_u32(src_p[4], 8u, 0xffu);
        dst_p->capture_time_us |= unpack_left_shift_u32(src_p[5], 16u, 0xffu);
        dst_p->capture_time_us |= unpack_left_shift_u32(src_p[6], 24u, 0xffu);
        dst_p->check = unpack_right_shift_u8(src_p[7], 0u, 0xffu);
        break;

    case 1:
        dst_p->displacement_sigma_mm = unpack_right_shift_u8(src_p[3], 0u, 0xffu);
        dst_p->shear_sigma_mm = unpack_right_shift_u8(src_p[4], 0u, 0xffu);
        dst_p->latency_us = unpack_right_shift_u16(src_p[5], 0u, 0xffu);
        dst_p->latency_us |= unpack_left_shift_u16(src_p[6], 8u, 0xffu);
        temperature_degc = unpack_right_shift_u8(src_p[7], 0u, 0xffu);
        dst_p->temperature_degc = (int8_t)temperature_degc;
        break;

    case 2:
        force_n = unpack_right_shift_u16(src_p[3], 0u, 0xffu);
        force_n |= unpack_left_shift_u16(src_p[4], 8u, 0xffu);
        dst_p->force_n = (int16_t)force_n;
        pressure_kpa = unpack_right_shift_u16(src_p[5], 0u, 0xffu);
        pressure_kpa |= unpack_left_shift_u16(src_p[6], 8u, 0xffu);
        dst_p->pressure_kpa = (int16_t)pressure_kpa;
        break;

    case 3:
        dst_p->contact_area_mm2 = unpack_right_shift_u16(src_p[3], 0u, 0xffu);
        dst_p->contact_area_mm2 |= unpack_left_shift_u16(src_p[4], 8u, 0xffu);
        orientation_deg = unpack_right_shift_u8(src_p[5], 0u, 0xffu);
        dst_p->orientation_deg = (int8_t)orientation_deg;
        dst_p->vibration_mm = unpack_right_shift_u8(src_p[6], 0u, 0xffu);
        break;

    case 4:
        tilt_x_deg = unpack_right_shift_u16(src_p[3], 0u, 0xffu);
        tilt_x_deg |= unpack_left_shift_u16(src_p[4], 8u, 0xffu);
        dst_p->tilt_x_deg = (int16_t)tilt_x_deg;
        tilt_y_deg = unpack_right_shift_u16(src_p[5], 0u, 0xffu);
        tilt_y_deg |= unpack_left_shift_u16(src_p[6], 8u, 0xffu);
        dst_p->tilt_y_deg = (int16_t)tilt_y_deg;
        break;

    case 5:
        torsion_deg = unpack_right_shift_u16(src_p[3], 0u, 0xffu);
        torsion_deg |= unpack_left_shift_u16(src_p[4], 8u, 0xffu);
        dst_p->torsion_deg = (int16_t)torsion_deg;
        dst_p->slip_speed_mm_s = unpack_right_shift_u8(src_p[5], 0u, 0xffu);
        dst_p->slip_probability = unpack_right_shift_u8(src_p[6], 0u, 0xffu);
        dst_p->twist_slip_probability = unpack_right_shift_u8(src_p[7], 0u, 0xffu);
        break;

    case 6:
        force_x_n = unpack_right_shift_u16(src_p[3], 0u, 0xffu);
        force_x_n |= unpack_left_shift_u16(src_p[4], 8u, 0xffu);
        dst_p->force_x_n = (int16_t)force_x_n;
        force_y_n = unpack_right_shift_u16(src_p[5], 0u, 0xffu);
        force_y_n |= unpack_left_shift_u16(src_p[6], 8u, 0xffu);
        dst_p->force_y_n = (int16_t)force_y_n;
        dst_p->force_xy_sigma_n = unpack_right_shift_u8(src_p[7], 0u, 0xffu);
        break;

    case 7:
        torque_z_nmm = unpack_right_shift_u16(src_p[3], 0u, 0xffu);
        torque_z_nmm |= unpack_left_shift_u16(src_p[4], 8u, 0xffu);
        dst_p->torque_z_nmm = (int16_t)torque_z_nmm;
        dst_p->torque_z_sigma_nmm = unpack_right_shift_u8(src_p[5], 0u, 0xffu);
        dst_p->friction = unpack_right_shift_u8(src_p[6], 0u, 0xffu);
        dst_p->slip_margin = unpack_right_shift_u8(src_p[7], 0u, 0xffu);
        break;

    default:
        break;
    }

    return (0);
}

int vt_classic_part3_init(struct vt_classic_part3_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_classic_part3_t));

    return 0;
}

uint8_t vt_classic_part3_crc_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part3_crc_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part3_crc_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_part3_crc_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint8_t vt_classic_part3_counter_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part3_counter_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part3_counter_is_in_range(uint8_t value)
{
    return (value <= 14u);
}

bool vt_classic_part3_counter_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 14.0f));
}

uint8_t vt_classic_part3_version_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part3_version_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part3_version_is_in_range(uint8_t value)
{
    return (value <= 15u);
}

bool vt_classic_part3_version_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 15.0f));
}

uint8_t vt_classic_part3_sample_low_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part3_sample_low_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part3_sample_low_is_in_range(uint8_t value)
{
    return (value <= 31u);
}

bool vt_classic_part3_sample_low_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 31.0f));
}

uint8_t vt_classic_part3_page_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part3_page_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part3_page_is_in_range(uint8_t value)
{
    return (value <= 7u);
}

bool vt_classic_part3_page_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 7.0f));
}

uint32_t vt_classic_part3_capture_time_us_encode(float value)
{
    return (uint32_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part3_capture_time_us_decode(uint32_t value)
{
    return ((float)value);
}

bool vt_classic_part3_capture_time_us_is_in_range(uint32_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_part3_capture_time_us_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 4294967295.0f));
}

uint8_t vt_classic_part3_displacement_sigma_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.008f)));
}

float vt_classic_part3_displacement_sigma_mm_decode(uint8_t value)
{
    return ((float)value * 0.008f);
}

bool vt_classic_part3_displacement_sigma_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_classic_part3_displacement_sigma_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 2.032f));
}

int16_t vt_classic_part3_force_n_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part3_force_n_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part3_force_n_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_classic_part3_force_n_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

uint16_t vt_classic_part3_contact_area_mm2_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value / 0.02f)));
}

float vt_classic_part3_contact_area_mm2_decode(uint16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_classic_part3_contact_area_mm2_is_in_range(uint16_t value)
{
    return (value <= 65500u);
}

bool vt_classic_part3_contact_area_mm2_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1310.0f));
}

int16_t vt_classic_part3_tilt_x_deg_encode(float value)
{
    return (int16_t)(roundf(value / 0.01f));
}

float vt_classic_part3_tilt_x_deg_decode(int16_t value)
{
    return ((float)value * 0.01f);
}

bool vt_classic_part3_tilt_x_deg_is_in_range(int16_t value)
{
    return ((value >= -18000) && (value <= 18000));
}

bool vt_classic_part3_tilt_x_deg_is_in_phys_range(float value)
{
    return ((value >= -180.0f) && (value <= 180.0f));
}

int16_t vt_classic_part3_torsion_deg_encode(float value)
{
    return (int16_t)(roundf(value / 0.01f));
}

float vt_classic_part3_torsion_deg_decode(int16_t value)
{
    return ((float)value * 0.01f);
}

bool vt_classic_part3_torsion_deg_is_in_range(int16_t value)
{
    return ((value >= -18000) && (value <= 18000));
}

bool vt_classic_part3_torsion_deg_is_in_phys_range(float value)
{
    return ((value >= -180.0f) && (value <= 180.0f));
}

int16_t vt_classic_part3_force_x_n_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part3_force_x_n_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part3_force_x_n_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_classic_part3_force_x_n_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

int16_t vt_classic_part3_torque_z_nmm_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_classic_part3_torque_z_nmm_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_classic_part3_torque_z_nmm_is_in_range(int16_t value)
{
    return ((value >= -32000) && (value <= 32000));
}

bool vt_classic_part3_torque_z_nmm_is_in_phys_range(float value)
{
    return ((value >= -640.0f) && (value <= 640.0f));
}

uint8_t vt_classic_part3_shear_sigma_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.008f)));
}

float vt_classic_part3_shear_sigma_mm_decode(uint8_t value)
{
    return ((float)value * 0.008f);
}

bool vt_classic_part3_shear_sigma_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_classic_part3_shear_sigma_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 2.032f));
}

uint16_t vt_classic_part3_latency_us_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value / 10.0f)));
}

float vt_classic_part3_latency_us_decode(uint16_t value)
{
    return ((float)value * 10.0f);
}

bool vt_classic_part3_latency_us_is_in_range(uint16_t value)
{
    return (value <= 65534u);
}

bool vt_classic_part3_latency_us_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 655340.0f));
}

int16_t vt_classic_part3_pressure_kpa_encode(float value)
{
    return (int16_t)(roundf(value / 0.05f));
}

float vt_classic_part3_pressure_kpa_decode(int16_t value)
{
    return ((float)value * 0.05f);
}

bool vt_classic_part3_pressure_kpa_is_in_range(int16_t value)
{
    return ((value >= -32000) && (value <= 32000));
}

bool vt_classic_part3_pressure_kpa_is_in_phys_range(float value)
{
    return ((value >= -1600.0f) && (value <= 1600.0f));
}

int8_t vt_classic_part3_orientation_deg_encode(float value)
{
    return (int8_t)(roundf(value / 0.75f));
}

float vt_classic_part3_orientation_deg_decode(int8_t value)
{
    return ((float)value * 0.75f);
}

bool vt_classic_part3_orientation_deg_is_in_range(int8_t value)
{
    return ((value >= -120) && (value <= 120));
}

bool vt_classic_part3_orientation_deg_is_in_phys_range(float value)
{
    return ((value >= -90.0f) && (value <= 90.0f));
}

int16_t vt_classic_part3_tilt_y_deg_encode(float value)
{
    return (int16_t)(roundf(value / 0.01f));
}

float vt_classic_part3_tilt_y_deg_decode(int16_t value)
{
    return ((float)value * 0.01f);
}

bool vt_classic_part3_tilt_y_deg_is_in_range(int16_t value)
{
    return ((value >= -18000) && (value <= 18000));
}

bool vt_classic_part3_tilt_y_deg_is_in_phys_range(float value)
{
    return ((value >= -180.0f) && (value <= 180.0f));
}

uint8_t vt_classic_part3_slip_speed_mm_s_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.25f)));
}

float vt_classic_part3_slip_speed_mm_s_decode(uint8_t value)
{
    return ((float)value * 0.25f);
}

bool vt_classic_part3_slip_speed_mm_s_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_classic_part3_slip_speed_mm_s_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 63.5f));
}

int16_t vt_classic_part3_force_y_n_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part3_force_y_n_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part3_force_y_n_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_classic_part3_force_y_n_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

uint8_t vt_classic_part3_torque_z_sigma_nmm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.1f)));
}

float vt_classic_part3_torque_z_sigma_nmm_decode(uint8_t value)
{
    return ((float)value * 0.1f);
}

bool vt_classic_part3_torque_z_sigma_nmm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_classic_part3_torque_z_sigma_nmm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 25.4f));
}

uint8_t vt_classic_part3_vibration_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.002f)));
}

float vt_classic_part3_vibration_mm_decode(uint8_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part3_vibration_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_classic_part3_vibration_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 0.508f));
}

uint8_t vt_classic_part3_slip_probability_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.004f)));
}

float vt_classic_part3_slip_probability_decode(uint8_t value)
{
    return ((float)value * 0.004f);
}

bool vt_classic_part3_slip_probability_is_in_range(uint8_t value)
{
    return (value <= 250u);
}

bool vt_classic_part3_slip_probability_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1.0f));
}

uint8_t vt_classic_part3_friction_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.02f)));
}

float vt_classic_part3_friction_decode(uint8_t value)
{
    return ((float)value * 0.02f);
}

bool vt_classic_part3_friction_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_classic_part3_friction_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 5.08f));
}

uint8_t vt_classic_part3_check_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part3_check_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part3_check_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_part3_check_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

int8_t vt_classic_part3_temperature_degc_encode(float value)
{
    return (int8_t)(roundf(value));
}

float vt_classic_part3_temperature_degc_decode(int8_t value)
{
    return ((float)value);
}

bool vt_classic_part3_temperature_degc_is_in_range(int8_t value)
{
    return ((value >= -40) && (value <= 125));
}

bool vt_classic_part3_temperature_degc_is_in_phys_range(float value)
{
    return ((value >= -40.0f) && (value <= 125.0f));
}

uint8_t vt_classic_part3_twist_slip_probability_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.004f)));
}

float vt_classic_part3_twist_slip_probability_decode(uint8_t value)
{
    return ((float)value * 0.004f);
}

bool vt_classic_part3_twist_slip_probability_is_in_range(uint8_t value)
{
    return (value <= 250u);
}

bool vt_classic_part3_twist_slip_probability_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1.0f));
}

uint8_t vt_classic_part3_force_xy_sigma_n_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.01f)));
}

float vt_classic_part3_force_xy_sigma_n_decode(uint8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_classic_part3_force_xy_sigma_n_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_classic_part3_force_xy_sigma_n_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 2.54f));
}

uint8_t vt_classic_part3_slip_margin_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.004f)));
}

float vt_classic_part3_slip_margin_decode(uint8_t value)
{
    return ((float)value * 0.004f);
}

bool vt_classic_part3_slip_margin_is_in_range(uint8_t value)
{
    return (value <= 250u);
}

bool vt_classic_part3_slip_margin_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1.0f));
}

int vt_classic_part4_pack(
    uint8_t *dst_p,
    const struct vt_classic_part4_t *src_p,
    size_t size)
{
    uint16_t contact0_x_mm;
    uint16_t contact0_y_mm;
    uint16_t contact1_x_mm;
    uint16_t contact1_y_mm;

    if (size < 8u) {
        return (-EINVAL);
    }

    memset(&dst_p[0], 0, 8);

    dst_p[0] |= pack_left_shift_u8(src_p->crc, 0u, 0xffu);
    dst_p[1] |= pack_left_shift_u8(src_p->counter, 0u, 0x0fu);
    dst_p[1] |= pack_left_shift_u8(src_p->version, 4u, 0xf0u);
    dst_p[2] |= pack_left_shift_u8(src_p->sample_low, 0u, 0x1fu);
    dst_p[2] |= pack_left_shift_u8(src_p->page, 5u, 0xe0u);

    switch (src_p->page) {

    case 0:
        contact0_x_mm = (uint16_t)src_p->contact0_x_mm;
        dst_p[3] |= pack_left_shift_u16(contact0_x_mm, 0u, 0xffu);
        dst_p[4] |= pack_right_shift_u16(contact0_x_mm, 8u, 0xffu);
        contact0_y_mm = (uint16_t)src_p->contact0_y_mm;
        dst_p[5] |= pack_left_shift_u16(contact0_y_mm, 0u, 0xffu);
        dst_p[6] |= pack_right_shift_u16(contact0_y_mm, 8u, 0xffu);
        dst_p[7] |= pack_left_shift_u8(src_p->contact0_depth_mm, 0u, 0xffu);
        break;

    case 1:
        contact1_x_mm = (uint16_t)src_p->contact1_x_mm;
        dst_p[3] |= pack_left_shift_u16(contact1_x_mm, 0u, 0xffu);
        dst_p[4] |= pack_right_shift_u16(contact1_x_mm, 8u, 0xffu);
        contact1_y_mm = (uint16_t)src_p->contact1_y_mm;
        dst_p[5] |= pack_left_shift_u16(contact1_y_mm, 0u, 0xffu);
        dst_p[6] |= pack_right_shift_u16(contact1_y_mm, 8u, 0xffu);
        dst_p[7] |= pack_left_shift_u8(src_p->contact1_depth_mm, 0u, 0xffu);
        break;

    default:
        break;
    }

    return (8);
}

int vt_classic_part4_unpack(
    struct vt_classic_part4_t *dst_p,
    const uint8_t *src_p,
    size_t size)
{
    uint16_t contact0_x_mm;
    uint16_t contact0_y_mm;
    uint16_t contact1_x_mm;
    uint16_t contact1_y_mm;

    if (size < 8u) {
        return (-EINVAL);
    }

    dst_p->crc = unpack_right_shift_u8(src_p[0], 0u, 0xffu);
    dst_p->counter = unpack_right_shift_u8(src_p[1], 0u, 0x0fu);
    dst_p->version = unpack_right_shift_u8(src_p[1], 4u, 0xf0u);
    dst_p->sample_low = unpack_right_shift_u8(src_p[2], 0u, 0x1fu);
    dst_p->page = unpack_right_shift_u8(src_p[2], 5u, 0xe0u);

    switch (dst_p->page) {

    case 0:
        contact0_x_mm = unpack_right_shift_u16(src_p[3], 0u, 0xffu);
        contact0_x_mm |= unpack_left_shift_u16(src_p[4], 8u, 0xffu);
        dst_p->contact0_x_mm = (int16_t)contact0_x_mm;
        contact0_y_mm = unpack_right_shift_u16(src_p[5], 0u, 0xffu);
        contact0_y_mm |= unpack_left_shift_u16(src_p[6], 8u, 0xffu);
        dst_p->contact0_y_mm = (int16_t)contact0_y_mm;
        dst_p->contact0_depth_mm = unpack_right_shift_u8(src_p[7], 0u, 0xffu);
        break;

    case 1:
        contact1_x_mm = unpack_right_shift_u16(src_p[3], 0u, 0xffu);
        contact1_x_mm |= unpack_left_shift_u16(src_p[4], 8u, 0xffu);
        dst_p->contact1_x_mm = (int16_t)contact1_x_mm;
        contact1_y_mm = unpack_right_shift_u16(src_p[5], 0u, 0xffu);
        contact1_y_mm |= unpack_left_shift_u16(src_p[6], 8u, 0xffu);
        dst_p->contact1_y_mm = (int16_t)contact1_y_mm;
        dst_p->contact1_depth_mm = unpack_right_shift_u8(src_p[7], 0u, 0xffu);
        break;

    default:
        break;
    }

    return (0);
}

int vt_classic_part4_init(struct vt_classic_part4_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_classic_part4_t));

    return 0;
}

uint8_t vt_classic_part4_crc_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part4_crc_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part4_crc_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_part4_crc_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint8_t vt_classic_part4_counter_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part4_counter_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part4_counter_is_in_range(uint8_t value)
{
    return (value <= 14u);
}

bool vt_classic_part4_counter_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 14.0f));
}

uint8_t vt_classic_part4_version_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part4_version_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part4_version_is_in_range(uint8_t value)
{
    return (value <= 15u);
}

bool vt_classic_part4_version_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 15.0f));
}

uint8_t vt_classic_part4_sample_low_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part4_sample_low_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part4_sample_low_is_in_range(uint8_t value)
{
    return (value <= 31u);
}

bool vt_classic_part4_sample_low_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 31.0f));
}

uint8_t vt_classic_part4_page_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_part4_page_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_part4_page_is_in_range(uint8_t value)
{
    return (value <= 7u);
}

bool vt_classic_part4_page_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 7.0f));
}

int16_t vt_classic_part4_contact0_x_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part4_contact0_x_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part4_contact0_x_mm_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_classic_part4_contact0_x_mm_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

int16_t vt_classic_part4_contact1_x_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part4_contact1_x_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part4_contact1_x_mm_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_classic_part4_contact1_x_mm_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

int16_t vt_classic_part4_contact0_y_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part4_contact0_y_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part4_contact0_y_mm_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_classic_part4_contact0_y_mm_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

int16_t vt_classic_part4_contact1_y_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_classic_part4_contact1_y_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_classic_part4_contact1_y_mm_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_classic_part4_contact1_y_mm_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

uint8_t vt_classic_part4_contact0_depth_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.025f)));
}

float vt_classic_part4_contact0_depth_mm_decode(uint8_t value)
{
    return ((float)value * 0.025f);
}

bool vt_classic_part4_contact0_depth_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_classic_part4_contact0_depth_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 6.35f));
}

uint8_t vt_classic_part4_contact1_depth_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.025f)));
}

float vt_classic_part4_contact1_depth_mm_decode(uint8_t value)
{
    return ((float)value * 0.025f);
}

bool vt_classic_part4_contact1_depth_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_classic_part4_contact1_depth_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 6.35f));
}

int vt_classic_emergency_pack(
    uint8_t *dst_p,
    const struct vt_classic_emergency_t *src_p,
    size_t size)
{
    if (size < 8u) {
        return (-EINVAL);
    }

    memset(&dst_p[0], 0, 8);

    dst_p[0] |= pack_left_shift_u16(src_p->emcy, 0u, 0xffu);
    dst_p[1] |= pack_right_shift_u16(src_p->emcy, 8u, 0xffu);
    dst_p[2] |= pack_left_shift_u8(src_p->error_register, 0u, 0xffu);
    dst_p[3] |= pack_left_shift_u8(src_p->fault, 0u, 0xffu);
    dst_p[4] |= pack_left_shift_u16(src_p->fault_status, 0u, 0xffu);
    dst_p[5] |= pack_right_shift_u16(src_p->fault_status, 8u, 0xffu);

    return (8);
}

int vt_classic_emergency_unpack(
    struct vt_classic_emergency_t *dst_p,
    const uint8_t *src_p,
    size_t size)
{
    if (size < 8u) {
        return (-EINVAL);
    }

    dst_p->emcy = unpack_right_shift_u16(src_p[0], 0u, 0xffu);
    dst_p->emcy |= unpack_left_shift_u16(src_p[1], 8u, 0xffu);
    dst_p->error_register = unpack_right_shift_u8(src_p[2], 0u, 0xffu);
    dst_p->fault = unpack_right_shift_u8(src_p[3], 0u, 0xffu);
    dst_p->fault_status = unpack_right_shift_u16(src_p[4], 0u, 0xffu);
    dst_p->fault_status |= unpack_left_shift_u16(src_p[5], 8u, 0xffu);

    return (0);
}

int vt_classic_emergency_init(struct vt_classic_emergency_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_classic_emergency_t));

    return 0;
}

uint16_t vt_classic_emergency_emcy_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_emergency_emcy_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_classic_emergency_emcy_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_emergency_emcy_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

uint8_t vt_classic_emergency_error_register_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_emergency_error_register_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_emergency_error_register_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_emergency_error_register_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint8_t vt_classic_emergency_fault_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_emergency_fault_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_emergency_fault_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_emergency_fault_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint16_t vt_classic_emergency_fault_status_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_emergency_fault_status_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_classic_emergency_fault_status_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_classic_emergency_fault_status_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

int vt_classic_heartbeat_pack(
    uint8_t *dst_p,
    const struct vt_classic_heartbeat_t *src_p,
    size_t size)
{
    if (size < 1u) {
        return (-EINVAL);
    }

    memset(&dst_p[0], 0, 1);

    dst_p[0] |= pack_left_shift_u8(src_p->nmt_state, 0u, 0x7fu);

    return (1);
}

int vt_classic_heartbeat_unpack(
    struct vt_classic_heartbeat_t *dst_p,
    const uint8_t *src_p,
    size_t size)
{
    if (size < 1u) {
        return (-EINVAL);
    }

    dst_p->nmt_state = unpack_right_shift_u8(src_p[0], 0u, 0x7fu);

    return (0);
}

int vt_classic_heartbeat_init(struct vt_classic_heartbeat_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_classic_heartbeat_t));

    return 0;
}

uint8_t vt_classic_heartbeat_nmt_state_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_classic_heartbeat_nmt_state_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_classic_heartbeat_nmt_state_is_in_range(uint8_t value)
{
    return (value <= 127u);
}

bool vt_classic_heartbeat_nmt_state_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 127.0f));
}
