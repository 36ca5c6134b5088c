/**
 * @file vt_fd.c
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

#include "vt_fd.h"

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

static inline uint8_t pack_right_shift_u8(
    uint8_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint8_t)((uint8_t)(value >> shift) & mask);
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

static inline uint8_t unpack_left_shift_u8(
    uint8_t value,
    uint8_t shift,
    uint8_t mask)
{
    return (uint8_t)((uint8_t)(value & mask) << shift);
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

int vt_fd_state_pack(
    uint8_t *dst_p,
    const struct vt_fd_state_t *src_p,
    size_t size)
{
    uint16_t contact0_x_mm;
    uint16_t contact0_y_mm;
    uint16_t contact1_x_mm;
    uint16_t contact1_y_mm;
    uint16_t displacement_mm;
    uint16_t force_n;
    uint16_t force_x_n;
    uint16_t force_y_n;
    uint16_t pressure_kpa;
    uint16_t shear_x_mm;
    uint16_t shear_y_mm;
    uint16_t tilt_x_deg;
    uint16_t tilt_y_deg;
    uint16_t torque_z_nmm;
    uint16_t torsion_deg;
    uint8_t orientation_deg;
    uint8_t temperature_degc;

    if (size < 64u) {
        return (-EINVAL);
    }

    memset(&dst_p[0], 0, 64);

    dst_p[0] |= pack_left_shift_u16(src_p->crc, 0u, 0xffu);
    dst_p[1] |= pack_right_shift_u16(src_p->crc, 8u, 0xffu);
    dst_p[2] |= pack_left_shift_u8(src_p->counter, 0u, 0xffu);
    dst_p[3] |= pack_left_shift_u8(src_p->version, 0u, 0xffu);
    dst_p[4] |= pack_left_shift_u16(src_p->sample, 0u, 0xffu);
    dst_p[5] |= pack_right_shift_u16(src_p->sample, 8u, 0xffu);
    dst_p[6] |= pack_left_shift_u16(src_p->status, 0u, 0xffu);
    dst_p[7] |= pack_right_shift_u16(src_p->status, 8u, 0xffu);
    dst_p[8] |= pack_left_shift_u32(src_p->capture_time_us, 0u, 0xffu);
    dst_p[9] |= pack_right_shift_u32(src_p->capture_time_us, 8u, 0xffu);
    dst_p[10] |= pack_right_shift_u32(src_p->capture_time_us, 16u, 0xffu);
    dst_p[11] |= pack_right_shift_u32(src_p->capture_time_us, 24u, 0xffu);
    dst_p[12] |= pack_left_shift_u16(src_p->latency_us, 0u, 0xffu);
    dst_p[13] |= pack_right_shift_u16(src_p->latency_us, 8u, 0xffu);
    dst_p[14] |= pack_left_shift_u8(src_p->pins_tracked, 0u, 0xffu);
    dst_p[15] |= pack_left_shift_u8(src_p->contact_n, 0u, 0xffu);
    displacement_mm = (uint16_t)src_p->displacement_mm;
    dst_p[16] |= pack_left_shift_u16(displacement_mm, 0u, 0xffu);
    dst_p[17] |= pack_right_shift_u16(displacement_mm, 8u, 0xffu);
    dst_p[18] |= pack_left_shift_u8(src_p->displacement_sigma_mm, 0u, 0xffu);
    force_n = (uint16_t)src_p->force_n;
    dst_p[19] |= pack_left_shift_u16(force_n, 0u, 0xffu);
    dst_p[20] |= pack_right_shift_u16(force_n, 8u, 0xffu);
    force_x_n = (uint16_t)src_p->force_x_n;
    dst_p[21] |= pack_left_shift_u16(force_x_n, 0u, 0xffu);
    dst_p[22] |= pack_right_shift_u16(force_x_n, 8u, 0xffu);
    force_y_n = (uint16_t)src_p->force_y_n;
    dst_p[23] |= pack_left_shift_u16(force_y_n, 0u, 0xffu);
    dst_p[24] |= pack_right_shift_u16(force_y_n, 8u, 0xffu);
    dst_p[25] |= pack_left_shift_u8(src_p->force_xy_sigma_n, 0u, 0xffu);
    torque_z_nmm = (uint16_t)src_p->torque_z_nmm;
    dst_p[26] |= pack_left_shift_u16(torque_z_nmm, 0u, 0xffu);
    dst_p[27] |= pack_right_shift_u16(torque_z_nmm, 8u, 0xffu);
    dst_p[28] |= pack_left_shift_u8(src_p->torque_z_sigma_nmm, 0u, 0xffu);
    dst_p[29] |= pack_left_shift_u8(src_p->friction, 0u, 0xffu);
    dst_p[30] |= pack_left_shift_u8(src_p->slip_margin, 0u, 0xffu);
    pressure_kpa = (uint16_t)src_p->pressure_kpa;
    dst_p[31] |= pack_left_shift_u16(pressure_kpa, 0u, 0xffu);
    dst_p[32] |= pack_right_shift_u16(pressure_kpa, 8u, 0xffu);
    dst_p[33] |= pack_left_shift_u16(src_p->contact_area_mm2, 0u, 0xffu);
    dst_p[34] |= pack_right_shift_u16(src_p->contact_area_mm2, 8u, 0xffu);
    shear_x_mm = (uint16_t)src_p->shear_x_mm;
    dst_p[35] |= pack_left_shift_u16(shear_x_mm, 0u, 0xffu);
    dst_p[36] |= pack_right_shift_u16(shear_x_mm, 8u, 0xffu);
    shear_y_mm = (uint16_t)src_p->shear_y_mm;
    dst_p[37] |= pack_left_shift_u16(shear_y_mm, 0u, 0xffu);
    dst_p[38] |= pack_right_shift_u16(shear_y_mm, 8u, 0xffu);
    dst_p[39] |= pack_left_shift_u8(src_p->shear_sigma_mm, 0u, 0xffu);
    torsion_deg = (uint16_t)src_p->torsion_deg;
    dst_p[40] |= pack_left_shift_u16(torsion_deg, 0u, 0xffu);
    dst_p[41] |= pack_right_shift_u16(torsion_deg, 8u, 0xffu);
    tilt_x_deg = (uint16_t)src_p->tilt_x_deg;
    dst_p[42] |= pack_left_shift_u16(tilt_x_deg, 0u, 0xffu);
    dst_p[43] |= pack_right_shift_u16(tilt_x_deg, 8u, 0xffu);
    tilt_y_deg = (uint16_t)src_p->tilt_y_deg;
    dst_p[44] |= pack_left_shift_u16(tilt_y_deg, 0u, 0xffu);
    dst_p[45] |= pack_right_shift_u16(tilt_y_deg, 8u, 0xffu);
    dst_p[46] |= pack_left_shift_u8(src_p->slip_speed_mm_s, 0u, 0xffu);
    dst_p[47] |= pack_left_shift_u8(src_p->slip_probability, 0u, 0xffu);
    dst_p[48] |= pack_left_shift_u8(src_p->twist_slip_probability, 0u, 0xffu);
    contact0_x_mm = (uint16_t)src_p->contact0_x_mm;
    dst_p[49] |= pack_left_shift_u16(contact0_x_mm, 0u, 0xffu);
    dst_p[50] |= pack_right_shift_u16(contact0_x_mm, 8u, 0xffu);
    contact0_y_mm = (uint16_t)src_p->contact0_y_mm;
    dst_p[51] |= pack_left_shift_u16(contact0_y_mm, 0u, 0xffu);
    dst_p[52] |= pack_right_shift_u16(contact0_y_mm, 8u, 0xffu);
    dst_p[53] |= pack_left_shift_u8(src_p->contact0_depth_mm, 0u, 0xffu);
    contact1_x_mm = (uint16_t)src_p->contact1_x_mm;
    dst_p[54] |= pack_left_shift_u16(contact1_x_mm, 0u, 0xffu);
    dst_p[55] |= pack_right_shift_u16(contact1_x_mm, 8u, 0xffu);
    contact1_y_mm = (uint16_t)src_p->contact1_y_mm;
    dst_p[56] |= pack_left_shift_u16(contact1_y_mm, 0u, 0xffu);
    dst_p[57] |= pack_right_shift_u16(contact1_y_mm, 8u, 0xffu);
    dst_p[58] |= pack_left_shift_u8(src_p->contact1_depth_mm, 0u, 0xffu);
    orientation_deg = (uint8_t)src_p->orientation_deg;
    dst_p[59] |= pack_left_shift_u8(orientation_deg, 0u, 0xffu);
    dst_p[60] |= pack_left_shift_u8(src_p->vibration_mm, 0u, 0xffu);
    temperature_degc = (uint8_t)src_p->temperature_degc;
    dst_p[61] |= pack_left_shift_u8(temperature_degc, 0u, 0xffu);
    dst_p[62] |= pack_left_shift_u16(src_p->check, 0u, 0xffu);
    dst_p[63] |= pack_right_shift_u16(src_p->check, 8u, 0xffu);

    return (64);
}

int vt_fd_state_unpack(
    struct vt_fd_state_t *dst_p,
    const uint8_t *src_p,
    size_t size)
{
    uint16_t contact0_x_mm;
    uint16_t contact0_y_mm;
    uint16_t contact1_x_mm;
    uint16_t contact1_y_mm;
    uint16_t displacement_mm;
    uint16_t force_n;
    uint16_t force_x_n;
    uint16_t force_y_n;
    uint16_t pressure_kpa;
    uint16_t shear_x_mm;
    uint16_t shear_y_mm;
    uint16_t tilt_x_deg;
    uint16_t tilt_y_deg;
    uint16_t torque_z_nmm;
    uint16_t torsion_deg;
    uint8_t orientation_deg;
    uint8_t temperature_degc;

    if (size < 64u) {
        return (-EINVAL);
    }

    dst_p->crc = unpack_right_shift_u16(src_p[0], 0u, 0xffu);
    dst_p->crc |= unpack_left_shift_u16(src_p[1], 8u, 0xffu);
    dst_p->counter = unpack_right_shift_u8(src_p[2], 0u, 0xffu);
    dst_p->version = unpack_right_shift_u8(src_p[3], 0u, 0xffu);
    dst_p->sample = unpack_right_shift_u16(src_p[4], 0u, 0xffu);
    dst_p->sample |= unpack_left_shift_u16(src_p[5], 8u, 0xffu);
    dst_p->status = unpack_right_shift_u16(src_p[6], 0u, 0xffu);
    dst_p->status |= unpack_left_shift_u16(src_p[7], 8u, 0xffu);
    dst_p->capture_time_us = unpack_right_shift_u32(src_p[8], 0u, 0xffu);
    dst_p->capture_time_us |= unpack_left_shift_u32(src_p[9], 8u, 0xffu);
    dst_p->capture_time_us |= unpack_left_shift_u32(src_p[10], 16u, 0xffu);
    dst_p->capture_time_us |= unpack_left_shift_u32(src_p[11], 24u, 0xffu);
    dst_p->latency_us = unpack_right_shift_u16(src_p[12], 0u, 0xffu);
    dst_p->latency_us |= unpack_left_shift_u16(src_p[13], 8u, 0xffu);
    dst_p->pins_tracked = unpack_right_shift_u8(src_p[14], 0u, 0xffu);
    dst_p->contact_n = unpack_right_shift_u8(src_p[15], 0u, 0xffu);
    displacement_mm = unpack_right_shift_u16(src_p[16], 0u, 0xffu);
    displacement_mm |= unpack_left_shift_u16(src_p[17], 8u, 0xffu);
    dst_p->displacement_mm = (int16_t)displacement_mm;
    dst_p->displacement_sigma_mm = unpack_right_shift_u8(src_p[18], 0u, 0xffu);
    force_n = unpack_right_shift_u16(src_p[19], 0u, 0xffu);
    force_n |= unpack_left_shift_u16(src_p[20], 8u, 0xffu);
    dst_p->force_n = (int16_t)force_n;
    force_x_n = unpack_right_shift_u16(src_p[21], 0u, 0xffu);
    force_x_n |= unpack_left_shift_u16(src_p[22], 8u, 0xffu);
    dst_p->force_x_n = (int16_t)force_x_n;
    force_y_n = unpack_right_shift_u16(src_p[23], 0u, 0xffu);
    force_y_n |= unpack_left_shift_u16(src_p[24], 8u, 0xffu);
    dst_p->force_y_n = (int16_t)force_y_n;
    dst_p->force_xy_sigma_n = unpack_right_shift_u8(src_p[25], 0u, 0xffu);
    torque_z_nmm = unpack_right_shift_u16(src_p[26], 0u, 0xffu);
    torque_z_nmm |= unpack_left_shift_u16(src_p[27], 8u, 0xffu);
    dst_p->torque_z_nmm = (int16_t)torque_z_nmm;
    dst_p->torque_z_sigma_nmm = unpack_right_shift_u8(src_p[28], 0u, 0xffu);
    dst_p->friction = unpack_right_shift_u8(src_p[29], 0u, 0xffu);
    dst_p->slip_margin = unpack_right_shift_u8(src_p[30], 0u, 0xffu);
    pressure_kpa = unpack_right_shift_u16(src_p[31], 0u, 0xffu);
    pressure_kpa |= unpack_left_shift_u16(src_p[32], 8u, 0xffu);
    dst_p->pressure_kpa = (int16_t)pressure_kpa;
    dst_p->contact_area_mm2 = unpack_right_shift_u16(src_p[33], 0u, 0xffu);
    dst_p->contact_area_mm2 |= unpack_left_shift_u16(src_p[34], 8u, 0xffu);
    shear_x_mm = unpack_right_shift_u16(src_p[35], 0u, 0xffu);
    shear_x_mm |= unpack_left_shift_u16(src_p[36], 8u, 0xffu);
    dst_p->shear_x_mm = (int16_t)shear_x_mm;
    shear_y_mm = unpack_right_shift_u16(src_p[37], 0u, 0xffu);
    shear_y_mm |= unpack_left_shift_u16(src_p[38], 8u, 0xffu);
    dst_p->shear_y_mm = (int16_t)shear_y_mm;
    dst_p->shear_sigma_mm = unpack_right_shift_u8(src_p[39], 0u, 0xffu);
    torsion_deg = unpack_right_shift_u16(src_p[40], 0u, 0xffu);
    torsion_deg |= unpack_left_shift_u16(src_p[41], 8u, 0xffu);
    dst_p->torsion_deg = (int16_t)torsion_deg;
    tilt_x_deg = unpack_right_shift_u16(src_p[42], 0u, 0xffu);
    tilt_x_deg |= unpack_left_shift_u16(src_p[43], 8u, 0xffu);
    dst_p->tilt_x_deg = (int16_t)tilt_x_deg;
    tilt_y_deg = unpack_right_shift_u16(src_p[44], 0u, 0xffu);
    tilt_y_deg |= unpack_left_shift_u16(src_p[45], 8u, 0xffu);
    dst_p->tilt_y_deg = (int16_t)tilt_y_deg;
    dst_p->slip_speed_mm_s = unpack_right_shift_u8(src_p[46], 0u, 0xffu);
    dst_p->slip_probability = unpack_right_shift_u8(src_p[47], 0u, 0xffu);
    dst_p->twist_slip_probability = unpack_right_shift_u8(src_p[48], 0u, 0xffu);
    contact0_x_mm = unpack_right_shift_u16(src_p[49], 0u, 0xffu);
    contact0_x_mm |= unpack_left_shift_u16(src_p[50], 8u, 0xffu);
    dst_p->contact0_x_mm = (int16_t)contact0_x_mm;
    contact0_y_mm = unpack_right_shift_u16(src_p[51], 0u, 0xffu);
    contact0_y_mm |= unpack_left_shift_u16(src_p[52], 8u, 0xffu);
    dst_p->contact0_y_mm = (int16_t)contact0_y_mm;
    dst_p->contact0_depth_mm = unpack_right_shift_u8(src_p[53], 0u, 0xffu);
    contact1_x_mm = unpack_right_shift_u16(src_p[54], 0u, 0xffu);
    contact1_x_mm |= unpack_left_shift_u16(src_p[55], 8u, 0xffu);
    dst_p->contact1_x_mm = (int16_t)contact1_x_mm;
    contact1_y_mm = unpack_right_shift_u16(src_p[56], 0u, 0xffu);
    contact1_y_mm |= unpack_left_shift_u16(src_p[57], 8u, 0xffu);
    dst_p->contact1_y_mm = (int16_t)contact1_y_mm;
    dst_p->contact1_depth_mm = unpack_right_shift_u8(src_p[58], 0u, 0xffu);
    orientation_deg = unpack_right_shift_u8(src_p[59], 0u, 0xffu);
    dst_p->orientation_deg = (int8_t)orientation_deg;
    dst_p->vibration_mm = unpack_right_shift_u8(src_p[60], 0u, 0xffu);
    temperature_degc = unpack_right_shift_u8(src_p[61], 0u, 0xffu);
    dst_p->temperature_degc = (int8_t)temperature_degc;
    dst_p->check = unpack_right_shift_u16(src_p[62], 0u, 0xffu);
    dst_p->check |= unpack_left_shift_u16(src_p[63], 8u, 0xffu);

    return (0);
}

int vt_fd_state_init(struct vt_fd_state_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_fd_state_t));

    return 0;
}

uint16_t vt_fd_state_crc_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_state_crc_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_fd_state_crc_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_state_crc_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

uint8_t vt_fd_state_counter_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_state_counter_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_state_counter_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_state_counter_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint8_t vt_fd_state_version_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_state_version_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_state_version_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_state_version_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint16_t vt_fd_state_sample_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_state_sample_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_fd_state_sample_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_state_sample_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

uint16_t vt_fd_state_status_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_state_status_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_fd_state_status_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_state_status_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

uint32_t vt_fd_state_capture_time_us_encode(float value)
{
    return (uint32_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_state_capture_time_us_decode(uint32_t value)
{
    return ((float)value);
}

bool vt_fd_state_capture_time_us_is_in_range(uint32_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_state_capture_time_us_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 4294967295.0f));
}

uint16_t vt_fd_state_latency_us_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value / 10.0f)));
}

float vt_fd_state_latency_us_decode(uint16_t value)
{
    return ((float)value * 10.0f);
}

bool vt_fd_state_latency_us_is_in_range(uint16_t value)
{
    return (value <= 65534u);
}

bool vt_fd_state_latency_us_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 655340.0f));
}

uint8_t vt_fd_state_pins_tracked_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.004f)));
}

float vt_fd_state_pins_tracked_decode(uint8_t value)
{
    return ((float)value * 0.004f);
}

bool vt_fd_state_pins_tracked_is_in_range(uint8_t value)
{
    return (value <= 250u);
}

bool vt_fd_state_pins_tracked_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1.0f));
}

uint8_t vt_fd_state_contact_n_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_state_contact_n_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_state_contact_n_is_in_range(uint8_t value)
{
    return (value <= 14u);
}

bool vt_fd_state_contact_n_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 14.0f));
}

int16_t vt_fd_state_displacement_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_displacement_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_displacement_mm_is_in_range(int16_t value)
{
    return ((value >= -8000) && (value <= 8000));
}

bool vt_fd_state_displacement_mm_is_in_phys_range(float value)
{
    return ((value >= -16.0f) && (value <= 16.0f));
}

uint8_t vt_fd_state_displacement_sigma_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.008f)));
}

float vt_fd_state_displacement_sigma_mm_decode(uint8_t value)
{
    return ((float)value * 0.008f);
}

bool vt_fd_state_displacement_sigma_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_state_displacement_sigma_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 2.032f));
}

int16_t vt_fd_state_force_n_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_force_n_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_force_n_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_fd_state_force_n_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

int16_t vt_fd_state_force_x_n_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_force_x_n_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_force_x_n_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_fd_state_force_x_n_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

int16_t vt_fd_state_force_y_n_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_force_y_n_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_force_y_n_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_fd_state_force_y_n_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

uint8_t vt_fd_state_force_xy_sigma_n_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.01f)));
}

float vt_fd_state_force_xy_sigma_n_decode(uint8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_state_force_xy_sigma_n_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_state_force_xy_sigma_n_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 2.54f));
}

int16_t vt_fd_state_torque_z_nmm_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_state_torque_z_nmm_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_state_torque_z_nmm_is_in_range(int16_t value)
{
    return ((value >= -32000) && (value <= 32000));
}

bool vt_fd_state_torque_z_nmm_is_in_phys_range(float value)
{
    return ((value >= -640.0f) && (value <= 640.0f));
}

uint8_t vt_fd_state_torque_z_sigma_nmm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.1f)));
}

float vt_fd_state_torque_z_sigma_nmm_decode(uint8_t value)
{
    return ((float)value * 0.1f);
}

bool vt_fd_state_torque_z_sigma_nmm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_state_torque_z_sigma_nmm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 25.4f));
}

uint8_t vt_fd_state_friction_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.02f)));
}

float vt_fd_state_friction_decode(uint8_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_state_friction_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_state_friction_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 5.08f));
}

uint8_t vt_fd_state_slip_margin_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.004f)));
}

float vt_fd_state_slip_margin_decode(uint8_t value)
{
    return ((float)value * 0.004f);
}

bool vt_fd_state_slip_margin_is_in_range(uint8_t value)
{
    return (value <= 250u);
}

bool vt_fd_state_slip_margin_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1.0f));
}

int16_t vt_fd_state_pressure_kpa_encode(float value)
{
    return (int16_t)(roundf(value / 0.05f));
}

float vt_fd_state_pressure_kpa_decode(int16_t value)
{
    return ((float)value * 0.05f);
}

bool vt_fd_state_pressure_kpa_is_in_range(int16_t value)
{
    return ((value >= -32000) && (value <= 32000));
}

bool vt_fd_state_pressure_kpa_is_in_phys_range(float value)
{
    return ((value >= -1600.0f) && (value <= 1600.0f));
}

uint16_t vt_fd_state_contact_area_mm2_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value / 0.02f)));
}

float vt_fd_state_contact_area_mm2_decode(uint16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_state_contact_area_mm2_is_in_range(uint16_t value)
{
    return (value <= 65500u);
}

bool vt_fd_state_contact_area_mm2_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1310.0f));
}

int16_t vt_fd_state_shear_x_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_shear_x_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_shear_x_mm_is_in_range(int16_t value)
{
    return ((value >= -8000) && (value <= 8000));
}

bool vt_fd_state_shear_x_mm_is_in_phys_range(float value)
{
    return ((value >= -16.0f) && (value <= 16.0f));
}

int16_t vt_fd_state_shear_y_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_shear_y_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_shear_y_mm_is_in_range(int16_t value)
{
    return ((value >= -8000) && (value <= 8000));
}

bool vt_fd_state_shear_y_mm_is_in_phys_range(float value)
{
    return ((value >= -16.0f) && (value <= 16.0f));
}

uint8_t vt_fd_state_shear_sigma_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.008f)));
}

float vt_fd_state_shear_sigma_mm_decode(uint8_t value)
{
    return ((float)value * 0.008f);
}

bool vt_fd_state_shear_sigma_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_state_shear_sigma_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 2.032f));
}

int16_t vt_fd_state_torsion_deg_encode(float value)
{
    return (int16_t)(roundf(value / 0.01f));
}

float vt_fd_state_torsion_deg_decode(int16_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_state_torsion_deg_is_in_range(int16_t value)
{
    return ((value >= -18000) && (value <= 18000));
}

bool vt_fd_state_torsion_deg_is_in_phys_range(float value)
{
    return ((value >= -180.0f) && (value <= 180.0f));
}

int16_t vt_fd_state_tilt_x_deg_encode(float value)
{
    return (int16_t)(roundf(value / 0.01f));
}

float vt_fd_state_tilt_x_deg_decode(int16_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_state_tilt_x_deg_is_in_range(int16_t value)
{
    return ((value >= -18000) && (value <= 18000));
}

bool vt_fd_state_tilt_x_deg_is_in_phys_range(float value)
{
    return ((value >= -180.0f) && (value <= 180.0f));
}

int16_t vt_fd_state_tilt_y_deg_encode(float value)
{
    return (int16_t)(roundf(value / 0.01f));
}

float vt_fd_state_tilt_y_deg_decode(int16_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_state_tilt_y_deg_is_in_range(int16_t value)
{
    return ((value >= -18000) && (value <= 18000));
}

bool vt_fd_state_tilt_y_deg_is_in_phys_range(float value)
{
    return ((value >= -180.0f) && (value <= 180.0f));
}

uint8_t vt_fd_state_slip_speed_mm_s_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.25f)));
}

float vt_fd_state_slip_speed_mm_s_decode(uint8_t value)
{
    return ((float)value * 0.25f);
}

bool vt_fd_state_slip_speed_mm_s_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_state_slip_speed_mm_s_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 63.5f));
}

uint8_t vt_fd_state_slip_probability_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.004f)));
}

float vt_fd_state_slip_probability_decode(uint8_t value)
{
    return ((float)value * 0.004f);
}

bool vt_fd_state_slip_probability_is_in_range(uint8_t value)
{
    return (value <= 250u);
}

bool vt_fd_state_slip_probability_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1.0f));
}

uint8_t vt_fd_state_twist_slip_probability_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.004f)));
}

float vt_fd_state_twist_slip_probability_decode(uint8_t value)
{
    return ((float)value * 0.004f);
}

bool vt_fd_state_twist_slip_probability_is_in_range(uint8_t value)
{
    return (value <= 250u);
}

bool vt_fd_state_twist_slip_probability_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 1.0f));
}

int16_t vt_fd_state_contact0_x_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_contact0_x_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_contact0_x_mm_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_fd_state_contact0_x_mm_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

int16_t vt_fd_state_contact0_y_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_contact0_y_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_contact0_y_mm_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_fd_state_contact0_y_mm_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

uint8_t vt_fd_state_contact0_depth_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.025f)));
}

float vt_fd_state_contact0_depth_mm_decode(uint8_t value)
{
    return ((float)value * 0.025f);
}

bool vt_fd_state_contact0_depth_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_state_contact0_depth_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 6.35f));
}

int16_t vt_fd_state_contact1_x_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_contact1_x_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_contact1_x_mm_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_fd_state_contact1_x_mm_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

int16_t vt_fd_state_contact1_y_mm_encode(float value)
{
    return (int16_t)(roundf(value / 0.002f));
}

float vt_fd_state_contact1_y_mm_decode(int16_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_contact1_y_mm_is_in_range(int16_t value)
{
    return ((value >= -32500) && (value <= 32500));
}

bool vt_fd_state_contact1_y_mm_is_in_phys_range(float value)
{
    return ((value >= -65.0f) && (value <= 65.0f));
}

uint8_t vt_fd_state_contact1_depth_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.025f)));
}

float vt_fd_state_contact1_depth_mm_decode(uint8_t value)
{
    return ((float)value * 0.025f);
}

bool vt_fd_state_contact1_depth_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_state_contact1_depth_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 6.35f));
}

int8_t vt_fd_state_orientation_deg_encode(float value)
{
    return (int8_t)(roundf(value / 0.75f));
}

float vt_fd_state_orientation_deg_decode(int8_t value)
{
    return ((float)value * 0.75f);
}

bool vt_fd_state_orientation_deg_is_in_range(int8_t value)
{
    return ((value >= -120) && (value <= 120));
}

bool vt_fd_state_orientation_deg_is_in_phys_range(float value)
{
    return ((value >= -90.0f) && (value <= 90.0f));
}

uint8_t vt_fd_state_vibration_mm_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value / 0.002f)));
}

float vt_fd_state_vibration_mm_decode(uint8_t value)
{
    return ((float)value * 0.002f);
}

bool vt_fd_state_vibration_mm_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_state_vibration_mm_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 0.508f));
}

int8_t vt_fd_state_temperature_degc_encode(float value)
{
    return (int8_t)(roundf(value));
}

float vt_fd_state_temperature_degc_decode(int8_t value)
{
    return ((float)value);
}

bool vt_fd_state_temperature_degc_is_in_range(int8_t value)
{
    return ((value >= -40) && (value <= 125));
}

bool vt_fd_state_temperature_degc_is_in_phys_range(float value)
{
    return ((value >= -40.0f) && (value <= 125.0f));
}

uint16_t vt_fd_state_check_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_state_check_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_fd_state_check_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_state_check_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

int vt_fd_detail_pack(
    uint8_t *dst_p,
    const struct vt_fd_detail_t *src_p,
    size_t size)
{
    uint16_t pin0_dx_px;
    uint16_t pin0_dy_px;
    uint16_t pin10_dx_px;
    uint16_t pin10_dy_px;
    uint16_t pin11_dx_px;
    uint16_t pin11_dy_px;
    uint16_t pin1_dx_px;
    uint16_t pin1_dy_px;
    uint16_t pin2_dx_px;
    uint16_t pin2_dy_px;
    uint16_t pin3_dx_px;
    uint16_t pin3_dy_px;
    uint16_t pin4_dx_px;
    uint16_t pin4_dy_px;
    uint16_t pin5_dx_px;
    uint16_t pin5_dy_px;
    uint16_t pin6_dx_px;
    uint16_t pin6_dy_px;
    uint16_t pin7_dx_px;
    uint16_t pin7_dy_px;
    uint16_t pin8_dx_px;
    uint16_t pin8_dy_px;
    uint16_t pin9_dx_px;
    uint16_t pin9_dy_px;
    uint8_t pin0_da;
    uint8_t pin10_da;
    uint8_t pin11_da;
    uint8_t pin1_da;
    uint8_t pin2_da;
    uint8_t pin3_da;
    uint8_t pin4_da;
    uint8_t pin5_da;
    uint8_t pin6_da;
    uint8_t pin7_da;
    uint8_t pin8_da;
    uint8_t pin9_da;

    if (size < 64u) {
        return (-EINVAL);
    }

    memset(&dst_p[0], 0, 64);

    dst_p[0] |= pack_left_shift_u16(src_p->crc, 0u, 0xffu);
    dst_p[1] |= pack_right_shift_u16(src_p->crc, 8u, 0xffu);
    dst_p[2] |= pack_left_shift_u8(src_p->counter, 0u, 0xffu);
    dst_p[3] |= pack_left_shift_u8(src_p->version, 0u, 0xffu);
    dst_p[4] |= pack_left_shift_u16(src_p->sample, 0u, 0xffu);
    dst_p[5] |= pack_right_shift_u16(src_p->sample, 8u, 0xffu);
    dst_p[6] |= pack_left_shift_u8(src_p->segment, 0u, 0xffu);
    dst_p[7] |= pack_left_shift_u8(src_p->segment_n, 0u, 0xffu);
    dst_p[8] |= pack_left_shift_u16(src_p->pin_n, 0u, 0xffu);
    dst_p[9] |= pack_right_shift_u16(src_p->pin_n, 8u, 0xffu);
    pin0_dx_px = (uint16_t)src_p->pin0_dx_px;
    dst_p[10] |= pack_left_shift_u16(pin0_dx_px, 0u, 0xffu);
    dst_p[11] |= pack_right_shift_u16(pin0_dx_px, 8u, 0x3fu);
    pin0_dy_px = (uint16_t)src_p->pin0_dy_px;
    dst_p[11] |= pack_left_shift_u16(pin0_dy_px, 6u, 0xc0u);
    dst_p[12] |= pack_right_shift_u16(pin0_dy_px, 2u, 0xffu);
    dst_p[13] |= pack_right_shift_u16(pin0_dy_px, 10u, 0x0fu);
    pin0_da = (uint8_t)src_p->pin0_da;
    dst_p[13] |= pack_left_shift_u8(pin0_da, 4u, 0xf0u);
    dst_p[14] |= pack_right_shift_u8(pin0_da, 4u, 0x0fu);
    pin1_dx_px = (uint16_t)src_p->pin1_dx_px;
    dst_p[14] |= pack_left_shift_u16(pin1_dx_px, 4u, 0xf0u);
    dst_p[15] |= pack_right_shift_u16(pin1_dx_px, 4u, 0xffu);
    dst_p[16] |= pack_right_shift_u16(pin1_dx_px, 12u, 0x03u);
    pin1_dy_px = (uint16_t)src_p->pin1_dy_px;
    dst_p[16] |= pack_left_shift_u16(pin1_dy_px, 2u, 0xfcu);
    dst_p[17] |= pack_right_shift_u16(pin1_dy_px, 6u, 0xffu);
    pin1_da = (uint8_t)src_p->pin1_da;
    dst_p[18] |= pack_left_shift_u8(pin1_da, 0u, 0xffu);
    pin2_dx_px = (uint16_t)src_p->pin2_dx_px;
    dst_p[19] |= pack_left_shift_u16(pin2_dx_px, 0u, 0xffu);
    dst_p[20] |= pack_right_shift_u16(pin2_dx_px, 8u, 0x3fu);
    pin2_dy_px = (uint16_t)src_p->pin2_dy_px;
    dst_p[20] |= pack_left_shift_u16(pin2_dy_px, 6u, 0xc0u);
    dst_p[21] |= pack_right_shift_u16(pin2_dy_px, 2u, 0xffu);
    dst_p[22] |= pack_right_shift_u16(pin2_dy_px, 10u, 0x0fu);
    pin2_da = (uint8_t)src_p->pin2_da;
    dst_p[22] |= pack_left_shift_u8(pin2_da, 4u, 0xf0u);
    dst_p[23] |= pack_right_shift_u8(pin2_da, 4u, 0x0fu);
    pin3_dx_px = (uint16_t)src_p->pin3_dx_px;
    dst_p[23] |= pack_left_shift_u16(pin3_dx_px, 4u, 0xf0u);
    dst_p[24] |= pack_right_shift_u16(pin3_dx_px, 4u, 0xffu);
    dst_p[25] |= pack_right_shift_u16(pin3_dx_px, 12u, 0x03u);
    pin3_dy_px = (uint16_t)src_p->pin3_dy_px;
    dst_p[25] |= pack_left_shift_u16(pin3_dy_px, 2u, 0xfcu);
    dst_p[26] |= pack_right_shift_u16(pin3_dy_px, 6u, 0xffu);
    pin3_da = (uint8_t)src_p->pin3_da;
    dst_p[27] |= pack_left_shift_u8(pin3_da, 0u, 0xffu);
    pin4_dx_px = (uint16_t)src_p->pin4_dx_px;
    dst_p[28] |= pack_left_shift_u16(pin4_dx_px, 0u, 0xffu);
    dst_p[29] |= pack_right_shift_u16(pin4_dx_px, 8u, 0x3fu);
    pin4_dy_px = (uint16_t)src_p->pin4_dy_px;
    dst_p[29] |= pack_left_shift_u16(pin4_dy_px, 6u, 0xc0u);
    dst_p[30] |= pack_right_shift_u16(pin4_dy_px, 2u, 0xffu);
    dst_p[31] |= pack_right_shift_u16(pin4_dy_px, 10u, 0x0fu);
    pin4_da = (uint8_t)src_p->pin4_da;
    dst_p[31] |= pack_left_shift_u8(pin4_da, 4u, 0xf0u);
    dst_p[32] |= pack_right_shift_u8(pin4_da, 4u, 0x0fu);
    pin5_dx_px = (uint16_t)src_p->pin5_dx_px;
    dst_p[32] |= pack_left_shift_u16(pin5_dx_px, 4u, 0xf0u);
    dst_p[33] |= pack_right_shift_u16(pin5_dx_px, 4u, 0xffu);
    dst_p[34] |= pack_right_shift_u16(pin5_dx_px, 12u, 0x03u);
    pin5_dy_px = (uint16_t)src_p->pin5_dy_px;
    dst_p[34] |= pack_left_shift_u16(pin5_dy_px, 2u, 0xfcu);
    dst_p[35] |= pack_right_shift_u16(pin5_dy_px, 6u, 0xffu);
    pin5_da = (uint8_t)src_p->pin5_da;
    dst_p[36] |= pack_left_shift_u8(pin5_da, 0u, 0xffu);
    pin6_dx_px = (uint16_t)src_p->pin6_dx_px;
    dst_p[37] |= pack_left_shift_u16(pin6_dx_px, 0u, 0xffu);
    dst_p[38] |= pack_right_shift_u16(pin6_dx_px, 8u, 0x3fu);
    pin6_dy_px = (uint16_t)src_p->pin6_dy_px;
    dst_p[38] |= pack_left_shift_u16(pin6_dy_px, 6u, 0xc0u);
    dst_p[39] |= pack_right_shift_u16(pin6_dy_px, 2u, 0xffu);
    dst_p[40] |= pack_right_shift_u16(pin6_dy_px, 10u, 0x0fu);
    pin6_da = (uint8_t)src_p->pin6_da;
    dst_p[40] |= pack_left_shift_u8(pin6_da, 4u, 0xf0u);
    dst_p[41] |= pack_right_shift_u8(pin6_da, 4u, 0x0fu);
    pin7_dx_px = (uint16_t)src_p->pin7_dx_px;
    dst_p[41] |= pack_left_shift_u16(pin7_dx_px, 4u, 0xf0u);
    dst_p[42] |= pack_right_shift_u16(pin7_dx_px, 4u, 0xffu);
    dst_p[43] |= pack_right_shift_u16(pin7_dx_px, 12u, 0x03u);
    pin7_dy_px = (uint16_t)src_p->pin7_dy_px;
    dst_p[43] |= pack_left_shift_u16(pin7_dy_px, 2u, 0xfcu);
    dst_p[44] |= pack_right_shift_u16(pin7_dy_px, 6u, 0xffu);
    pin7_da = (uint8_t)src_p->pin7_da;
    dst_p[45] |= pack_left_shift_u8(pin7_da, 0u, 0xffu);
    pin8_dx_px = (uint16_t)src_p->pin8_dx_px;
    dst_p[46] |= pack_left_shift_u16(pin8_dx_px, 0u, 0xffu);
    dst_p[47] |= pack_right_shift_u16(pin8_dx_px, 8u, 0x3fu);
    pin8_dy_px = (uint16_t)src_p->pin8_dy_px;
    dst_p[47] |= pack_left_shift_u16(pin8_dy_px, 6u, 0xc0u);
    dst_p[48] |= pack_right_shift_u16(pin8_dy_px, 2u, 0xffu);
    dst_p[49] |= pack_right_shift_u16(pin8_dy_px, 10u, 0x0fu);
    pin8_da = (uint8_t)src_p->pin8_da;
    dst_p[49] |= pack_left_shift_u8(pin8_da, 4u, 0xf0u);
    dst_p[50] |= pack_right_shift_u8(pin8_da, 4u, 0x0fu);
    pin9_dx_px = (uint16_t)src_p->pin9_dx_px;
    dst_p[50] |= pack_left_shift_u16(pin9_dx_px, 4u, 0xf0u);
    dst_p[51] |= pack_right_shift_u16(pin9_dx_px, 4u, 0xffu);
    dst_p[52] |= pack_right_shift_u16(pin9_dx_px, 12u, 0x03u);
    pin9_dy_px = (uint16_t)src_p->pin9_dy_px;
    dst_p[52] |= pack_left_shift_u16(pin9_dy_px, 2u, 0xfcu);
    dst_p[53] |= pack_right_shift_u16(pin9_dy_px, 6u, 0xffu);
    pin9_da = (uint8_t)src_p->pin9_da;
    dst_p[54] |= pack_left_shift_u8(pin9_da, 0u, 0xffu);
    pin10_dx_px = (uint16_t)src_p->pin10_dx_px;
    dst_p[55] |= pack_left_shift_u16(pin10_dx_px, 0u, 0xffu);
    dst_p[56] |= pack_right_shift_u16(pin10_dx_px, 8u, 0x3fu);
    pin10_dy_px = (uint16_t)src_p->pin10_dy_px;
    dst_p[56] |= pack_left_shift_u16(pin10_dy_px, 6u, 0xc0u);
    dst_p[57] |= pack_right_shift_u16(pin10_dy_px, 2u, 0xffu);
    dst_p[58] |= pack_right_shift_u16(pin10_dy_px, 10u, 0x0fu);
    pin10_da = (uint8_t)src_p->pin10_da;
    dst_p[58] |= pack_left_shift_u8(pin10_da, 4u, 0xf0u);
    dst_p[59] |= pack_right_shift_u8(pin10_da, 4u, 0x0fu);
    pin11_dx_px = (uint16_t)src_p->pin11_dx_px;
    dst_p[59] |= pack_left_shift_u16(pin11_dx_px, 4u, 0xf0u);
    dst_p[60] |= pack_right_shift_u16(pin11_dx_px, 4u, 0xffu);
    dst_p[61] |= pack_right_shift_u16(pin11_dx_px, 12u, 0x03u);
    pin11_dy_px = (uint16_t)src_p->pin11_dy_px;
    dst_p[61] |= pack_left_shift_u16(pin11_dy_px, 2u, 0xfcu);
    dst_p[62] |= pack_right_shift_u16(pin11_dy_px, 6u, 0xffu);
    pin11_da = (uint8_t)src_p->pin11_da;
    dst_p[63] |= pack_left_shift_u8(pin11_da, 0u, 0xffu);

    return (64);
}

int vt_fd_detail_unpack(
    struct vt_fd_detail_t *dst_p,
    const uint8_t *src_p,
    size_t size)
{
    uint16_t pin0_dx_px;
    uint16_t pin0_dy_px;
    uint16_t pin10_dx_px;
    uint16_t pin10_dy_px;
    uint16_t pin11_dx_px;
    uint16_t pin11_dy_px;
    uint16_t pin1_dx_px;
    uint16_t pin1_dy_px;
    uint16_t pin2_dx_px;
    uint16_t pin2_dy_px;
    uint16_t pin3_dx_px;
    uint16_t pin3_dy_px;
    uint16_t pin4_dx_px;
    uint16_t pin4_dy_px;
    uint16_t pin5_dx_px;
    uint16_t pin5_dy_px;
    uint16_t pin6_dx_px;
    uint16_t pin6_dy_px;
    uint16_t pin7_dx_px;
    uint16_t pin7_dy_px;
    uint16_t pin8_dx_px;
    uint16_t pin8_dy_px;
    uint16_t pin9_dx_px;
    uint16_t pin9_dy_px;
    uint8_t pin0_da;
    uint8_t pin10_da;
    uint8_t pin11_da;
    uint8_t pin1_da;
    uint8_t pin2_da;
    uint8_t pin3_da;
    uint8_t pin4_da;
    uint8_t pin5_da;
    uint8_t pin6_da;
    uint8_t pin7_da;
    uint8_t pin8_da;
    uint8_t pin9_da;

    if (size < 64u) {
        return (-EINVAL);
    }

    dst_p->crc = unpack_right_shift_u16(src_p[0], 0u, 0xffu);
    dst_p->crc |= unpack_left_shift_u16(src_p[1], 8u, 0xffu);
    dst_p->counter = unpack_right_shift_u8(src_p[2], 0u, 0xffu);
    dst_p->version = unpack_right_shift_u8(src_p[3], 0u, 0xffu);
    dst_p->sample = unpack_right_shift_u16(src_p[4], 0u, 0xffu);
    dst_p->sample |= unpack_left_shift_u16(src_p[5], 8u, 0xffu);
    dst_p->segment = unpack_right_shift_u8(src_p[6], 0u, 0xffu);
    dst_p->segment_n = unpack_right_shift_u8(src_p[7], 0u, 0xffu);
    dst_p->pin_n = unpack_right_shift_u16(src_p[8], 0u, 0xffu);
    dst_p->pin_n |= unpack_left_shift_u16(src_p[9], 8u, 0xffu);
    pin0_dx_px = unpack_right_shift_u16(src_p[10], 0u, 0xffu);
    pin0_dx_px |= unpack_left_shift_u16(src_p[11], 8u, 0x3fu);

    if ((pin0_dx_px & (1u << 13)) != 0u) {
        pin0_dx_px |= 0xc000u;
    }

    dst_p->pin0_dx_px = (int16_t)pin0_dx_px;
    pin0_dy_px = unpack_right_shift_u16(src_p[11], 6u, 0xc0u);
    pin0_dy_px |= unpack_left_shift_u16(src_p[12], 2u, 0xffu);
    pin0_dy_px |= unpack_left_shift_u16(src_p[13], 10u, 0x0fu);

    if ((pin0_dy_px & (1u << 13)) != 0u) {
        pin0_dy_px |= 0xc000u;
    }

    dst_p->pin0_dy_px = (int16_t)pin0_dy_px;
    pin0_da = unpack_right_shift_u8(src_p[13], 4u, 0xf0u);
    pin0_da |= unpack_left_shift_u8(src_p[14], 4u, 0x0fu);
    dst_p->pin0_da = (int8_t)pin0_da;
    pin1_dx_px = unpack_right_shift_u16(src_p[14], 4u, 0xf0u);
    pin1_dx_px |= unpack_left_shift_u16(src_p[15], 4u, 0xffu);
    pin1_dx_px |= unpack_left_shift_u16(src_p[16], 12u, 0x03u);

    if ((pin1_dx_px & (1u << 13)) != 0u) {
        pin1_dx_px |= 0xc000u;
    }

    dst_p->pin1_dx_px = (int16_t)pin1_dx_px;
    pin1_dy_px = unpack_right_shift_u16(src_p[16], 2u, 0xfcu);
    pin1_dy_px |= unpack_left_shift_u16(src_p[17], 6u, 0xffu);

    if ((pin1_dy_px & (1u << 13)) != 0u) {
        pin1_dy_px |= 0xc000u;
    }

    dst_p->pin1_dy_px = (int16_t)pin1_dy_px;
    pin1_da = unpack_right_shift_u8(src_p[18], 0u, 0xffu);
    dst_p->pin1_da = (int8_t)pin1_da;
    pin2_dx_px = unpack_right_shift_u16(src_p[19], 0u, 0xffu);
    pin2_dx_px |= unpack_left_shift_u16(src_p[20], 8u, 0x3fu);

    if ((pin2_dx_px & (1u << 13)) != 0u) {
        pin2_dx_px |= 0xc000u;
    }

    dst_p->pin2_dx_px = (int16_t)pin2_dx_px;
    pin2_dy_px = unpack_right_shift_u16(src_p[20], 6u, 0xc0u);
    pin2_dy_px |= unpack_left_shift_u16(src_p[21], 2u, 0xffu);
    pin2_dy_px |= unpack_left_shift_u16(src_p[22], 10u, 0x0fu);

    if ((pin2_dy_px & (1u << 13)) != 0u) {
        pin2_dy_px |= 0xc000u;
    }

    dst_p->pin2_dy_px = (int16_t)pin2_dy_px;
    pin2_da = unpack_right_shift_u8(src_p[22], 4u, 0xf0u);
    pin2_da |= unpack_left_shift_u8(src_p[23], 4u, 0x0fu);
    dst_p->pin2_da = (int8_t)pin2_da;
    pin3_dx_px = unpack_right_shift_u16(src_p[23], 4u, 0xf0u);
    pin3_dx_px |= unpack_left_shift_u16(src_p[24], 4u, 0xffu);
    pin3_dx_px |= unpack_left_shift_u16(src_p[25], 12u, 0x03u);

    if ((pin3_dx_px & (1u << 13)) != 0u) {
        pin3_dx_px |= 0xc000u;
    }

    dst_p->pin3_dx_px = (int16_t)pin3_dx_px;
    pin3_dy_px = unpack_right_shift_u16(src_p[25], 2u, 0xfcu);
    pin3_dy_px |= unpack_left_shift_u16(src_p[26], 6u, 0xffu);

    if ((pin3_dy_px & (1u << 13)) != 0u) {
        pin3_dy_px |= 0xc000u;
    }

    dst_p->pin3_dy_px = (int16_t)pin3_dy_px;
    pin3_da = unpack_right_shift_u8(src_p[27], 0u, 0xffu);
    dst_p->pin3_da = (int8_t)pin3_da;
    pin4_dx_px = unpack_right_shift_u16(src_p[28], 0u, 0xffu);
    pin4_dx_px |= unpack_left_shift_u16(src_p[29], 8u, 0x3fu);

    if ((pin4_dx_px & (1u << 13)) != 0u) {
        pin4_dx_px |= 0xc000u;
    }

    dst_p->pin4_dx_px = (int16_t)pin4_dx_px;
    pin4_dy_px = unpack_right_shift_u16(src_p[29], 6u, 0xc0u);
    pin4_dy_px |= unpack_left_shift_u16(src_p[30], 2u, 0xffu);
    pin4_dy_px |= unpack_left_shift_u16(src_p[31], 10u, 0x0fu);

    if ((pin4_dy_px & (1u << 13)) != 0u) {
        pin4_dy_px |= 0xc000u;
    }

    dst_p->pin4_dy_px = (int16_t)pin4_dy_px;
    pin4_da = unpack_right_shift_u8(src_p[31], 4u, 0xf0u);
    pin4_da |= unpack_left_shift_u8(src_p[32], 4u, 0x0fu);
    dst_p->pin4_da = (int8_t)pin4_da;
    pin5_dx_px = unpack_right_shift_u16(src_p[32], 4u, 0xf0u);
    pin5_dx_px |= unpack_left_shift_u16(src_p[33], 4u, 0xffu);
    pin5_dx_px |= unpack_left_shift_u16(src_p[34], 12u, 0x03u);

    if ((pin5_dx_px & (1u << 13)) != 0u) {
        pin5_dx_px |= 0xc000u;
    }

    dst_p->pin5_dx_px = (int16_t)pin5_dx_px;
    pin5_dy_px = unpack_right_shift_u16(src_p[34], 2u, 0xfcu);
    pin5_dy_px |= unpack_left_shift_u16(src_p[35], 6u, 0xffu);

    if ((pin5_dy_px & (1u << 13)) != 0u) {
        pin5_dy_px |= 0xc000u;
    }

    dst_p->pin5_dy_px = (int16_t)pin5_dy_px;
    pin5_da = unpack_right_shift_u8(src_p[36], 0u, 0xffu);
    dst_p->pin5_da = (int8_t)pin5_da;
    pin6_dx_px = unpack_right_shift_u16(src_p[37], 0u, 0xffu);
    pin6_dx_px |= unpack_left_shift_u16(src_p[38], 8u, 0x3fu);

    if ((pin6_dx_px & (1u << 13)) != 0u) {
        pin6_dx_px |= 0xc000u;
    }

    dst_p->pin6_dx_px = (int16_t)pin6_dx_px;
    pin6_dy_px = unpack_right_shift_u16(src_p[38], 6u, 0xc0u);
    pin6_dy_px |= unpack_left_shift_u16(src_p[39], 2u, 0xffu);
    pin6_dy_px |= unpack_left_shift_u16(src_p[40], 10u, 0x0fu);

    if ((pin6_dy_px & (1u << 13)) != 0u) {
        pin6_dy_px |= 0xc000u;
    }

    dst_p->pin6_dy_px = (int16_t)pin6_dy_px;
    pin6_da = unpack_right_shift_u8(src_p[40], 4u, 0xf0u);
    pin6_da |= unpack_left_shift_u8(src_p[41], 4u, 0x0fu);
    dst_p->pin6_da = (int8_t)pin6_da;
    pin7_dx_px = unpack_right_shift_u16(src_p[41], 4u, 0xf0u);
    pin7_dx_px |= unpack_left_shift_u16(src_p[42], 4u, 0xffu);
    pin7_dx_px |= unpack_left_shift_u16(src_p[43], 12u, 0x03u);

    if ((pin7_dx_px & (1u << 13)) != 0u) {
        pin7_dx_px |= 0xc000u;
    }

    dst_p->pin7_dx_px = (int16_t)pin7_dx_px;
    pin7_dy_px = unpack_right_shift_u16(src_p[43], 2u, 0xfcu);
    pin7_dy_px |= unpack_left_shift_u16(src_p[44], 6u, 0xffu);

    if ((pin7_dy_px & (1u << 13)) != 0u) {
        pin7_dy_px |= 0xc000u;
    }

    dst_p->pin7_dy_px = (int16_t)pin7_dy_px;
    pin7_da = unpack_right_shift_u8(src_p[45], 0u, 0xffu);
    dst_p->pin7_da = (int8_t)pin7_da;
    pin8_dx_px = unpack_right_shift_u16(src_p[46], 0u, 0xffu);
    pin8_dx_px |= unpack_left_shift_u16(src_p[47], 8u, 0x3fu);

    if ((pin8_dx_px & (1u << 13)) != 0u) {
        pin8_dx_px |= 0xc000u;
    }

    dst_p->pin8_dx_px = (int16_t)pin8_dx_px;
    pin8_dy_px = unpack_right_shift_u16(src_p[47], 6u, 0xc0u);
    pin8_dy_px |= unpack_left_shift_u16(src_p[48], 2u, 0xffu);
    pin8_dy_px |= unpack_left_shift_u16(src_p[49], 10u, 0x0fu);

    if ((pin8_dy_px & (1u << 13)) != 0u) {
        pin8_dy_px |= 0xc000u;
    }

    dst_p->pin8_dy_px = (int16_t)pin8_dy_px;
    pin8_da = unpack_right_shift_u8(src_p[49], 4u, 0xf0u);
    pin8_da |= unpack_left_shift_u8(src_p[50], 4u, 0x0fu);
    dst_p->pin8_da = (int8_t)pin8_da;
    pin9_dx_px = unpack_right_shift_u16(src_p[50], 4u, 0xf0u);
    pin9_dx_px |= unpack_left_shift_u16(src_p[51], 4u, 0xffu);
    pin9_dx_px |= unpack_left_shift_u16(src_p[52], 12u, 0x03u);

    if ((pin9_dx_px & (1u << 13)) != 0u) {
        pin9_dx_px |= 0xc000u;
    }

    dst_p->pin9_dx_px = (int16_t)pin9_dx_px;
    pin9_dy_px = unpack_right_shift_u16(src_p[52], 2u, 0xfcu);
    pin9_dy_px |= unpack_left_shift_u16(src_p[53], 6u, 0xffu);

    if ((pin9_dy_px & (1u << 13)) != 0u) {
        pin9_dy_px |= 0xc000u;
    }

    dst_p->pin9_dy_px = (int16_t)pin9_dy_px;
    pin9_da = unpack_right_shift_u8(src_p[54], 0u, 0xffu);
    dst_p->pin9_da = (int8_t)pin9_da;
    pin10_dx_px = unpack_right_shift_u16(src_p[55], 0u, 0xffu);
    pin10_dx_px |= unpack_left_shift_u16(src_p[56], 8u, 0x3fu);

    if ((pin10_dx_px & (1u << 13)) != 0u) {
        pin10_dx_px |= 0xc000u;
    }

    dst_p->pin10_dx_px = (int16_t)pin10_dx_px;
    pin10_dy_px = unpack_right_shift_u16(src_p[56], 6u, 0xc0u);
    pin10_dy_px |= unpack_left_shift_u16(src_p[57], 2u, 0xffu);
    pin10_dy_px |= unpack_left_shift_u16(src_p[58], 10u, 0x0fu);

    if ((pin10_dy_px & (1u << 13)) != 0u) {
        pin10_dy_px |= 0xc000u;
    }

    dst_p->pin10_dy_px = (int16_t)pin10_dy_px;
    pin10_da = unpack_right_shift_u8(src_p[58], 4u, 0xf0u);
    pin10_da |= unpack_left_shift_u8(src_p[59], 4u, 0x0fu);
    dst_p->pin10_da = (int8_t)pin10_da;
    pin11_dx_px = unpack_right_shift_u16(src_p[59], 4u, 0xf0u);
    pin11_dx_px |= unpack_left_shift_u16(src_p[60], 4u, 0xffu);
    pin11_dx_px |= unpack_left_shift_u16(src_p[61], 12u, 0x03u);

    if ((pin11_dx_px & (1u << 13)) != 0u) {
        pin11_dx_px |= 0xc000u;
    }

    dst_p->pin11_dx_px = (int16_t)pin11_dx_px;
    pin11_dy_px = unpack_right_shift_u16(src_p[61], 2u, 0xfcu);
    pin11_dy_px |= unpack_left_shift_u16(src_p[62], 6u, 0xffu);

    if ((pin11_dy_px & (1u << 13)) != 0u) {
        pin11_dy_px |= 0xc000u;
    }

    dst_p->pin11_dy_px = (int16_t)pin11_dy_px;
    pin11_da = unpack_right_shift_u8(src_p[63], 0u, 0xffu);
    dst_p->pin11_da = (int8_t)pin11_da;

    return (0);
}

int vt_fd_detail_init(struct vt_fd_detail_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_fd_detail_t));

    return 0;
}

uint16_t vt_fd_detail_crc_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_detail_crc_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_fd_detail_crc_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_detail_crc_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

uint8_t vt_fd_detail_counter_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_detail_counter_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_detail_counter_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_detail_counter_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint8_t vt_fd_detail_version_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_detail_version_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_detail_version_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_detail_version_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint16_t vt_fd_detail_sample_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_detail_sample_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_fd_detail_sample_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_detail_sample_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

uint8_t vt_fd_detail_segment_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_detail_segment_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_detail_segment_is_in_range(uint8_t value)
{
    return (value <= 254u);
}

bool vt_fd_detail_segment_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 254.0f));
}

uint8_t vt_fd_detail_segment_n_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_detail_segment_n_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_detail_segment_n_is_in_range(uint8_t value)
{
    return (value >= 1u);
}

bool vt_fd_detail_segment_n_is_in_phys_range(float value)
{
    return ((value >= 1.0f) && (value <= 255.0f));
}

uint16_t vt_fd_detail_pin_n_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_detail_pin_n_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_fd_detail_pin_n_is_in_range(uint16_t value)
{
    return (value <= 3060u);
}

bool vt_fd_detail_pin_n_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 3060.0f));
}

int16_t vt_fd_detail_pin0_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin0_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin0_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin0_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin0_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin0_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin0_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin0_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin0_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin0_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin0_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin0_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin1_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin1_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin1_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin1_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin1_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin1_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin1_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin1_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin1_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin1_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin1_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin1_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin2_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin2_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin2_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin2_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin2_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin2_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin2_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin2_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin2_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin2_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin2_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin2_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin3_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin3_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin3_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin3_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin3_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin3_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin3_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin3_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin3_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin3_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin3_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin3_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin4_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin4_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin4_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin4_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin4_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin4_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin4_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin4_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin4_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin4_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin4_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin4_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin5_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin5_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin5_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin5_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin5_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin5_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin5_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin5_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin5_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin5_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin5_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin5_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin6_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin6_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin6_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin6_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin6_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin6_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin6_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin6_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin6_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin6_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin6_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin6_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin7_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin7_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin7_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin7_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin7_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin7_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin7_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin7_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin7_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin7_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin7_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin7_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin8_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin8_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin8_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin8_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin8_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin8_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin8_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin8_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin8_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin8_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin8_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin8_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin9_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin9_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin9_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin9_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin9_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin9_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin9_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin9_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin9_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin9_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin9_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin9_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin10_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin10_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin10_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin10_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin10_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin10_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin10_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin10_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin10_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin10_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin10_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin10_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int16_t vt_fd_detail_pin11_dx_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin11_dx_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin11_dx_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin11_dx_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int16_t vt_fd_detail_pin11_dy_px_encode(float value)
{
    return (int16_t)(roundf(value / 0.02f));
}

float vt_fd_detail_pin11_dy_px_decode(int16_t value)
{
    return ((float)value * 0.02f);
}

bool vt_fd_detail_pin11_dy_px_is_in_range(int16_t value)
{
    return ((value >= -8191) && (value <= 8191));
}

bool vt_fd_detail_pin11_dy_px_is_in_phys_range(float value)
{
    return ((value >= -163.82f) && (value <= 163.82f));
}

int8_t vt_fd_detail_pin11_da_encode(float value)
{
    return (int8_t)(roundf(value / 0.01f));
}

float vt_fd_detail_pin11_da_decode(int8_t value)
{
    return ((float)value * 0.01f);
}

bool vt_fd_detail_pin11_da_is_in_range(int8_t value)
{
    return (value >= -127);
}

bool vt_fd_detail_pin11_da_is_in_phys_range(float value)
{
    return ((value >= -1.27f) && (value <= 1.27f));
}

int vt_fd_emergency_pack(
    uint8_t *dst_p,
    const struct vt_fd_emergency_t *src_p,
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

int vt_fd_emergency_unpack(
    struct vt_fd_emergency_t *dst_p,
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

int vt_fd_emergency_init(struct vt_fd_emergency_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_fd_emergency_t));

    return 0;
}

uint16_t vt_fd_emergency_emcy_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_emergency_emcy_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_fd_emergency_emcy_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_emergency_emcy_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

uint8_t vt_fd_emergency_error_register_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_emergency_error_register_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_emergency_error_register_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_emergency_error_register_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint8_t vt_fd_emergency_fault_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_emergency_fault_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_emergency_fault_is_in_range(uint8_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_emergency_fault_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 255.0f));
}

uint16_t vt_fd_emergency_fault_status_encode(float value)
{
    return (uint16_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_emergency_fault_status_decode(uint16_t value)
{
    return ((float)value);
}

bool vt_fd_emergency_fault_status_is_in_range(uint16_t value)
{
    (void)value;

    return (true);
}

bool vt_fd_emergency_fault_status_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 65535.0f));
}

int vt_fd_heartbeat_pack(
    uint8_t *dst_p,
    const struct vt_fd_heartbeat_t *src_p,
    size_t size)
{
    if (size < 1u) {
        return (-EINVAL);
    }

    memset(&dst_p[0], 0, 1);

    dst_p[0] |= pack_left_shift_u8(src_p->nmt_state, 0u, 0x7fu);

    return (1);
}

int vt_fd_heartbeat_unpack(
    struct vt_fd_heartbeat_t *dst_p,
    const uint8_t *src_p,
    size_t size)
{
    if (size < 1u) {
        return (-EINVAL);
    }

    dst_p->nmt_state = unpack_right_shift_u8(src_p[0], 0u, 0x7fu);

    return (0);
}

int vt_fd_heartbeat_init(struct vt_fd_heartbeat_t *msg_p)
{
    if (msg_p == NULL) return -1;

    memset(msg_p, 0, sizeof(struct vt_fd_heartbeat_t));

    return 0;
}

uint8_t vt_fd_heartbeat_nmt_state_encode(float value)
{
    return (uint8_t)(cantools_unsigned_from_double(roundf(value)));
}

float vt_fd_heartbeat_nmt_state_decode(uint8_t value)
{
    return ((float)value);
}

bool vt_fd_heartbeat_nmt_state_is_in_range(uint8_t value)
{
    return (value <= 127u);
}

bool vt_fd_heartbeat_nmt_state_is_in_phys_range(float value)
{
    return ((value >= 0.0f) && (value <= 127.0f));
}
