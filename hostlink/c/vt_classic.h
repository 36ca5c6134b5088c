/**
 * @file vt_classic.h
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

#ifndef VT_CLASSIC_H
#define VT_CLASSIC_H

#ifdef __cplusplus
extern "C" {
#endif

#include <stdint.h>
#include <stdbool.h>
#include <stddef.h>

#ifndef EINVAL
#    define EINVAL 22
#endif

/* Frame ids. */
#define VT_CLASSIC_PART1_FRAME_ID (0x181u)
#define VT_CLASSIC_PART2_FRAME_ID (0x281u)
#define VT_CLASSIC_PART3_FRAME_ID (0x381u)
#define VT_CLASSIC_PART4_FRAME_ID (0x481u)
#define VT_CLASSIC_EMERGENCY_FRAME_ID (0x81u)
#define VT_CLASSIC_HEARTBEAT_FRAME_ID (0x701u)

/* Frame lengths in bytes. */
#define VT_CLASSIC_PART1_LENGTH (8u)
#define VT_CLASSIC_PART2_LENGTH (8u)
#define VT_CLASSIC_PART3_LENGTH (8u)
#define VT_CLASSIC_PART4_LENGTH (8u)
#define VT_CLASSIC_EMERGENCY_LENGTH (8u)
#define VT_CLASSIC_HEARTBEAT_LENGTH (1u)

/* Extended or standard frame types. */
#define VT_CLASSIC_PART1_IS_EXTENDED (0)
#define VT_CLASSIC_PART2_IS_EXTENDED (0)
#define VT_CLASSIC_PART3_IS_EXTENDED (0)
#define VT_CLASSIC_PART4_IS_EXTENDED (0)
#define VT_CLASSIC_EMERGENCY_IS_EXTENDED (0)
#define VT_CLASSIC_HEARTBEAT_IS_EXTENDED (0)

/* Frame cycle times in milliseconds. */
#define VT_CLASSIC_HEARTBEAT_CYCLE_TIME_MS (500u)

/* Signal choices. */
#define VT_CLASSIC_PART1_DISPLACEMENT_MM_INVALID_CHOICE (-8192)

#define VT_CLASSIC_PART1_SHEAR_X_MM_INVALID_CHOICE (-8192)

#define VT_CLASSIC_PART1_SHEAR_Y_MM_INVALID_CHOICE (-8192)

#define VT_CLASSIC_PART2_PINS_TRACKED_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_DISPLACEMENT_SIGMA_MM_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_FORCE_N_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART3_CONTACT_AREA_MM2_INVALID_CHOICE (65535u)

#define VT_CLASSIC_PART3_TILT_X_DEG_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART3_TORSION_DEG_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART3_FORCE_X_N_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART3_TORQUE_Z_NMM_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART3_SHEAR_SIGMA_MM_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_LATENCY_US_INVALID_CHOICE (65535u)

#define VT_CLASSIC_PART3_PRESSURE_KPA_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART3_ORIENTATION_DEG_INVALID_CHOICE (-128)

#define VT_CLASSIC_PART3_TILT_Y_DEG_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART3_SLIP_SPEED_MM_S_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_FORCE_Y_N_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART3_TORQUE_Z_SIGMA_NMM_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_VIBRATION_MM_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_SLIP_PROBABILITY_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_FRICTION_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_TEMPERATURE_DEGC_INVALID_CHOICE (-128)

#define VT_CLASSIC_PART3_TWIST_SLIP_PROBABILITY_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_FORCE_XY_SIGMA_N_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART3_SLIP_MARGIN_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART4_CONTACT0_X_MM_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART4_CONTACT1_X_MM_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART4_CONTACT0_Y_MM_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART4_CONTACT1_Y_MM_INVALID_CHOICE (-32768)

#define VT_CLASSIC_PART4_CONTACT0_DEPTH_MM_INVALID_CHOICE (255u)

#define VT_CLASSIC_PART4_CONTACT1_DEPTH_MM_INVALID_CHOICE (255u)

#define VT_CLASSIC_EMERGENCY_EMCY_NONE_CHOICE (0u)
#define VT_CLASSIC_EMERGENCY_EMCY_OVER_TEMPERATURE_CHOICE (16897u)
#define VT_CLASSIC_EMERGENCY_EMCY_CAMERA_LOST_CHOICE (20481u)
#define VT_CLASSIC_EMERGENCY_EMCY_CAMERA_STALLED_CHOICE (20482u)
#define VT_CLASSIC_EMERGENCY_EMCY_IMAGE_DARK_CHOICE (20483u)
#define VT_CLASSIC_EMERGENCY_EMCY_IMAGE_BRIGHT_CHOICE (20484u)
#define VT_CLASSIC_EMERGENCY_EMCY_IMAGE_BLURRED_CHOICE (20485u)
#define VT_CLASSIC_EMERGENCY_EMCY_CAMERA_MOVED_CHOICE (20486u)
#define VT_CLASSIC_EMERGENCY_EMCY_DISK_FULL_CHOICE (24577u)
#define VT_CLASSIC_EMERGENCY_EMCY_CLOCK_STEP_CHOICE (24578u)
#define VT_CLASSIC_EMERGENCY_EMCY_TRACKER_LOST_CHOICE (24833u)
#define VT_CLASSIC_EMERGENCY_EMCY_CALIBRATION_MISSING_CHOICE (25345u)
#define VT_CLASSIC_EMERGENCY_EMCY_CALIBRATION_FOREIGN_CHOICE (25346u)
#define VT_CLASSIC_EMERGENCY_EMCY_TARE_IMPLAUSIBLE_CHOICE (25347u)
#define VT_CLASSIC_EMERGENCY_EMCY_LINK_DOWN_CHOICE (33025u)
#define VT_CLASSIC_EMERGENCY_EMCY_BUS_OFF_CHOICE (33088u)
#define VT_CLASSIC_EMERGENCY_EMCY_PINS_LOST_CHOICE (36865u)
#define VT_CLASSIC_EMERGENCY_EMCY_OVERLOAD_CHOICE (36866u)

#define VT_CLASSIC_EMERGENCY_FAULT_NONE_CHOICE (0u)
#define VT_CLASSIC_EMERGENCY_FAULT_CAMERA_LOST_CHOICE (1u)
#define VT_CLASSIC_EMERGENCY_FAULT_CAMERA_STALLED_CHOICE (2u)
#define VT_CLASSIC_EMERGENCY_FAULT_IMAGE_DARK_CHOICE (3u)
#define VT_CLASSIC_EMERGENCY_FAULT_IMAGE_BRIGHT_CHOICE (4u)
#define VT_CLASSIC_EMERGENCY_FAULT_IMAGE_BLURRED_CHOICE (5u)
#define VT_CLASSIC_EMERGENCY_FAULT_CAMERA_MOVED_CHOICE (6u)
#define VT_CLASSIC_EMERGENCY_FAULT_PINS_LOST_CHOICE (7u)
#define VT_CLASSIC_EMERGENCY_FAULT_TRACKER_LOST_CHOICE (8u)
#define VT_CLASSIC_EMERGENCY_FAULT_CALIBRATION_MISSING_CHOICE (9u)
#define VT_CLASSIC_EMERGENCY_FAULT_CALIBRATION_FOREIGN_CHOICE (10u)
#define VT_CLASSIC_EMERGENCY_FAULT_TARE_IMPLAUSIBLE_CHOICE (11u)
#define VT_CLASSIC_EMERGENCY_FAULT_OVERLOAD_CHOICE (12u)
#define VT_CLASSIC_EMERGENCY_FAULT_LINK_DOWN_CHOICE (13u)
#define VT_CLASSIC_EMERGENCY_FAULT_BUS_OFF_CHOICE (14u)
#define VT_CLASSIC_EMERGENCY_FAULT_DISK_FULL_CHOICE (15u)
#define VT_CLASSIC_EMERGENCY_FAULT_CLOCK_STEP_CHOICE (16u)
#define VT_CLASSIC_EMERGENCY_FAULT_OVER_TEMPERATURE_CHOICE (17u)

#define VT_CLASSIC_HEARTBEAT_NMT_STATE_BOOT_UP_CHOICE (0u)
#define VT_CLASSIC_HEARTBEAT_NMT_STATE_STOPPED_CHOICE (4u)
#define VT_CLASSIC_HEARTBEAT_NMT_STATE_OPERATIONAL_CHOICE (5u)
#define VT_CLASSIC_HEARTBEAT_NMT_STATE_PRE_OPERATIONAL_CHOICE (127u)

/* Frame Names. */
#define VT_CLASSIC_PART1_NAME "Part1"
#define VT_CLASSIC_PART2_NAME "Part2"
#define VT_CLASSIC_PART3_NAME "Part3"
#define VT_CLASSIC_PART4_NAME "Part4"
#define VT_CLASSIC_EMERGENCY_NAME "Emergency"
#define VT_CLASSIC_HEARTBEAT_NAME "Heartbeat"

/* Signal Names. */
#define VT_CLASSIC_PART1_CRC_NAME "crc"
#define VT_CLASSIC_PART1_COUNTER_NAME "counter"
#define VT_CLASSIC_PART1_VERSION_NAME "version"
#define VT_CLASSIC_PART1_SAMPLE_LOW_NAME "sample_low"
#define VT_CLASSIC_PART1_DISPLACEMENT_MM_NAME "displacement_mm"
#define VT_CLASSIC_PART1_SHEAR_X_MM_NAME "shear_x_mm"
#define VT_CLASSIC_PART1_SHEAR_Y_MM_NAME "shear_y_mm"
#define VT_CLASSIC_PART2_CRC_NAME "crc"
#define VT_CLASSIC_PART2_COUNTER_NAME "counter"
#define VT_CLASSIC_PART2_VERSION_NAME "version"
#define VT_CLASSIC_PART2_SAMPLE_LOW_NAME "sample_low"
#define VT_CLASSIC_PART2_STATUS_NAME "status"
#define VT_CLASSIC_PART2_SAMPLE_HIGH_NAME "sample_high"
#define VT_CLASSIC_PART2_PINS_TRACKED_NAME "pins_tracked"
#define VT_CLASSIC_PART2_CONTACT_N_NAME "contact_n"
#define VT_CLASSIC_PART2_PART_N_NAME "part_n"
#define VT_CLASSIC_PART3_CRC_NAME "crc"
#define VT_CLASSIC_PART3_COUNTER_NAME "counter"
#define VT_CLASSIC_PART3_VERSION_NAME "version"
#define VT_CLASSIC_PART3_SAMPLE_LOW_NAME "sample_low"
#define VT_CLASSIC_PART3_PAGE_NAME "page"
#define VT_CLASSIC_PART3_CAPTURE_TIME_US_NAME "capture_time_us"
#define VT_CLASSIC_PART3_DISPLACEMENT_SIGMA_MM_NAME "displacement_sigma_mm"
#define VT_CLASSIC_PART3_FORCE_N_NAME "force_n"
#define VT_CLASSIC_PART3_CONTACT_AREA_MM2_NAME "contact_area_mm2"
#define VT_CLASSIC_PART3_TILT_X_DEG_NAME "tilt_x_deg"
#define VT_CLASSIC_PART3_TORSION_DEG_NAME "torsion_deg"
#define VT_CLASSIC_PART3_FORCE_X_N_NAME "force_x_n"
#define VT_CLASSIC_PART3_TORQUE_Z_NMM_NAME "torque_z_nmm"
#define VT_CLASSIC_PART3_SHEAR_SIGMA_MM_NAME "shear_sigma_mm"
#define VT_CLASSIC_PART3_LATENCY_US_NAME "latency_us"
#define VT_CLASSIC_PART3_PRESSURE_KPA_NAME "pressure_kpa"
#define VT_CLASSIC_PART3_ORIENTATION_DEG_NAME "orientation_deg"
#define VT_CLASSIC_PART3_TILT_Y_DEG_NAME "tilt_y_deg"
#define VT_CLASSIC_PART3_SLIP_SPEED_MM_S_NAME "slip_speed_mm_s"
#define VT_CLASSIC_PART3_FORCE_Y_N_NAME "force_y_n"
#define VT_CLASSIC_PART3_TORQUE_Z_SIGMA_NMM_NAME "torque_z_sigma_nmm"
#define VT_CLASSIC_PART3_VIBRATION_MM_NAME "vibration_mm"
#define VT_CLASSIC_PART3_SLIP_PROBABILITY_NAME "slip_probability"
#define VT_CLASSIC_PART3_FRICTION_NAME "friction"
#define VT_CLASSIC_PART3_CHECK_NAME "check"
#define VT_CLASSIC_PART3_TEMPERATURE_DEGC_NAME "temperature_degc"
#define VT_CLASSIC_PART3_TWIST_SLIP_PROBABILITY_NAME "twist_slip_probability"
#define VT_CLASSIC_PART3_FORCE_XY_SIGMA_N_NAME "force_xy_sigma_n"
#define VT_CLASSIC_PART3_SLIP_MARGIN_NAME "slip_margin"
#define VT_CLASSIC_PART4_CRC_NAME "crc"
#define VT_CLASSIC_PART4_COUNTER_NAME "counter"
#define VT_CLASSIC_PART4_VERSION_NAME "version"
#define VT_CLASSIC_PART4_SAMPLE_LOW_NAME "sample_low"
#define VT_CLASSIC_PART4_PAGE_NAME "page"
#define VT_CLASSIC_PART4_CONTACT0_X_MM_NAME "contact0_x_mm"
#define VT_CLASSIC_PART4_CONTACT1_X_MM_NAME "contact1_x_mm"
#define VT_CLASSIC_PART4_CONTACT0_Y_MM_NAME "contact0_y_mm"
#define VT_CLASSIC_PART4_CONTACT1_Y_MM_NAME "contact1_y_mm"
#define VT_CLASSIC_PART4_CONTACT0_DEPTH_MM_NAME "contact0_depth_mm"
#define VT_CLASSIC_PART4_CONTACT1_DEPTH_MM_NAME "contact1_depth_mm"
#define VT_CLASSIC_EMERGENCY_EMCY_NAME "emcy"
#define VT_CLASSIC_EMERGENCY_ERROR_REGISTER_NAME "error_register"
#define VT_CLASSIC_EMERGENCY_FAULT_NAME "fault"
#define VT_CLASSIC_EMERGENCY_FAULT_STATUS_NAME "fault_status"
#define VT_CLASSIC_HEARTBEAT_NMT_STATE_NAME "nmt_state"

/**
 * Signals in message Part1.
 *
 * Motion of the skin.
 *
 * All signal values are as on the CAN bus.
 */
struct vt_classic_part1_t {
    /**
     * E2E profile 11C CRC-8 over the rest and the data id
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t crc;

    /**
     * E2E counter: counts samples, the same in all their parts
     *
     * Range: 0..14 (0..14 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t counter;

    /**
     * layout version modulo 16: nibble of the data id
     *
     * Range: 0..15 (0..15 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t version;

    /**
     * lower 5 bits of the sample number
     *
     * Range: 0..31 (0..31 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t sample_low;

    /**
     * depth by which the skin is pressed in, along z; positive is into the tip
     *
     * Range: -8000..8000 (-16..16 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t displacement_mm;

    /**
     * motion of the contact along x (tip frame) since contact
     *
     * Range: -8000..8000 (-16..16 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t shear_x_mm;

    /**
     * motion of the contact along y (tip frame) since contact
     *
     * Range: -8000..8000 (-16..16 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t shear_y_mm;
};

/**
 * Signals in message Part2.
 *
 * Status, and how many messages this sample has.
 *
 * All signal values are as on the CAN bus.
 */
struct vt_classic_part2_t {
    /**
     * E2E profile 11C CRC-8 over the rest and the data id
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t crc;

    /**
     * E2E counter: counts samples, the same in all their parts
     *
     * Range: 0..14 (0..14 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t counter;

    /**
     * layout version modulo 16: nibble of the data id
     *
     * Range: 0..15 (0..15 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t version;

    /**
     * lower 5 bits of the sample number
     *
     * Range: 0..31 (0..31 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t sample_low;

    /**
     * status bits, see the table of status bits
     *
     * Range: 0..65535 (0..65535 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t status;

    /**
     * upper 11 bits of the sample number; the lower 5 are sample_low
     *
     * Range: 0..2047 (0..2047 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t sample_high;

    /**
     * share of the pins whose place is known, 0..1
     *
     * Range: 0..250 (0..1 -)
     * Scale: 0.004
     * Offset: 0
     */
    uint8_t pins_tracked;

    /**
     * number of separate contacts; up to 2 of them are listed below
     *
     * Range: 0..14 (0..14 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t contact_n;

    /**
     * number of messages of this sample; complete when so many came
     *
     * Range: 0..15 (0..15 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t part_n;
};

/**
 * Signals in message Part3.
 *
 * Pages: time, sigmas, force, area, tilt, torsion and slip, friction. 0 and 1 come with every sample.
 *
 * All signal values are as on the CAN bus.
 */
struct vt_classic_part3_t {
    /**
     * E2E profile 11C CRC-8 over the rest and the data id
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t crc;

    /**
     * E2E counter: counts samples, the same in all their parts
     *
     * Range: 0..14 (0..14 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t counter;

    /**
     * layout version modulo 16: nibble of the data id
     *
     * Range: 0..15 (0..15 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t version;

    /**
     * lower 5 bits of the sample number
     *
     * Range: 0..31 (0..31 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t sample_low;

    /**
     * which page of this message
     *
     * Range: 0..7 (0..7 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t page;

    /**
     * start of exposure on the sensor's monotonic clock; wraps to 0 after 71.6 minutes
     *
     * Range: 0..4294967295 (0..4294967295 us)
     * Scale: 1
     * Offset: 0
     */
    uint32_t capture_time_us;

    /**
     * standard deviation of the displacement
     *
     * Range: 0..254 (0..2.032 mm)
     * Scale: 0.008
     * Offset: 0
     */
    uint8_t displacement_sigma_mm;

    /**
     * normal force on the tip; positive presses the tip
     *
     * Range: -32500..32500 (-65..65 N)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t force_n;

    /**
     * area of skin in contact, all contacts together
     *
     * Range: 0..65500 (0..1310 mm2)
     * Scale: 0.02
     * Offset: 0
     */
    uint16_t contact_area_mm2;

    /**
     * tilt of the touched surface about x, right-handed
     *
     * Range: -18000..18000 (-180..180 deg)
     * Scale: 0.01
     * Offset: 0
     */
    int16_t tilt_x_deg;

    /**
     * twist of the contact about z, positive from x to y
     *
     * Range: -18000..18000 (-180..180 deg)
     * Scale: 0.01
     * Offset: 0
     */
    int16_t torsion_deg;

    /**
     * friction force on the tip along x (tip frame): what drags the skin towards x is positive
     *
     * Range: -32500..32500 (-65..65 N)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t force_x_n;

    /**
     * torque of the friction on the tip about z, positive from x to y
     *
     * Range: -32000..32000 (-640..640 Nmm)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t torque_z_nmm;

    /**
     * standard deviation of each axis of the shear
     *
     * Range: 0..254 (0..2.032 mm)
     * Scale: 0.008
     * Offset: 0
     */
    uint8_t shear_sigma_mm;

    /**
     * time from capture to sending of this sample
     *
     * Range: 0..65534 (0..655340 us)
     * Scale: 10
     * Offset: 0
     */
    uint16_t latency_us;

    /**
     * force over contact area
     *
     * Range: -32000..32000 (-1600..1600 kPa)
     * Scale: 0.05
     * Offset: 0
     */
    int16_t pressure_kpa;

    /**
     * direction of the long axis of the contact (edge), from x towards y, in (-90, 90]
     *
     * Range: -120..120 (-90..90 deg)
     * Scale: 0.75
     * Offset: 0
     */
    int8_t orientation_deg;

    /**
     * tilt of the touched surface about y, right-handed
     *
     * Range: -18000..18000 (-180..180 deg)
     * Scale: 0.01
     * Offset: 0
     */
    int16_t tilt_y_deg;

    /**
     * speed of the skin beyond what the load explains
     *
     * Range: 0..254 (0..63.5 mm/s)
     * Scale: 0.25
     * Offset: 0
     */
    uint8_t slip_speed_mm_s;

    /**
     * friction force on the tip along y (tip frame)
     *
     * Range: -32500..32500 (-65..65 N)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t force_y_n;

    /**
     * standard deviation of the torque
     *
     * Range: 0..254 (0..25.4 Nmm)
     * Scale: 0.1
     * Offset: 0
     */
    uint8_t torque_z_sigma_nmm;

    /**
     * rms motion of the contact's pins above 10 Hz, up to half the rate of images; 0: no contact
     *
     * Range: 0..254 (0..0.508 mm)
     * Scale: 0.002
     * Offset: 0
     */
    uint8_t vibration_mm;

    /**
     * probability that more than a third of the contact's area slides, 0..1; slip begins at the rim
     *
     * Range: 0..250 (0..1 -)
     * Scale: 0.004
     * Offset: 0
     */
    uint8_t slip_probability;

    /**
     * largest tangential over normal load that this contact has held, its torque included
     *
     * Range: 0..254 (0..5.08 -)
     * Scale: 0.02
     * Offset: 0
     */
    uint8_t friction;

    /**
     * low byte of the state frame's check: CRC-32 over version and fields as they lie there
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t check;

    /**
     * temperature of the board
     *
     * Range: -40..125 (-40..125 degC)
     * Scale: 1.0
     * Offset: 0
     */
    int8_t temperature_degc;

    /**
     * the same of a twist alone, 0..1; slip_probability is the larger one of twist and drag
     *
     * Range: 0..250 (0..1 -)
     * Scale: 0.004
     * Offset: 0
     */
    uint8_t twist_slip_probability;

    /**
     * standard deviation of force_x_n and of force_y_n
     *
     * Range: 0..254 (0..2.54 N)
     * Scale: 0.01
     * Offset: 0
     */
    uint8_t force_xy_sigma_n;

    /**
     * 1 less the present tangential over normal load in units of `friction`; 0: nothing more has been held; not known before the first tangential load of a contact
     *
     * Range: 0..250 (0..1 -)
     * Scale: 0.004
     * Offset: 0
     */
    uint8_t slip_margin;
};

/**
 * Signals in message Part4.
 *
 * Pages: a contact each; sent while there is one.
 *
 * All signal values are as on the CAN bus.
 */
struct vt_classic_part4_t {
    /**
     * E2E profile 11C CRC-8 over the rest and the data id
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t crc;

    /**
     * E2E counter: counts samples, the same in all their parts
     *
     * Range: 0..14 (0..14 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t counter;

    /**
     * layout version modulo 16: nibble of the data id
     *
     * Range: 0..15 (0..15 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t version;

    /**
     * lower 5 bits of the sample number
     *
     * Range: 0..31 (0..31 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t sample_low;

    /**
     * which page of this message
     *
     * Range: 0..7 (0..7 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t page;

    /**
     * place of contact 0, x (tip frame)
     *
     * Range: -32500..32500 (-65..65 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t contact0_x_mm;

    /**
     * place of contact 1, x (tip frame)
     *
     * Range: -32500..32500 (-65..65 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t contact1_x_mm;

    /**
     * place of contact 0, y (tip frame)
     *
     * Range: -32500..32500 (-65..65 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t contact0_y_mm;

    /**
     * place of contact 1, y (tip frame)
     *
     * Range: -32500..32500 (-65..65 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t contact1_y_mm;

    /**
     * depth of contact 0 into the skin
     *
     * Range: 0..254 (0..6.35 mm)
     * Scale: 0.025
     * Offset: 0
     */
    uint8_t contact0_depth_mm;

    /**
     * depth of contact 1 into the skin
     *
     * Range: 0..254 (0..6.35 mm)
     * Scale: 0.025
     * Offset: 0
     */
    uint8_t contact1_depth_mm;
};

/**
 * Signals in message Emergency.
 *
 * A fault has appeared or cleared.
 *
 * All signal values are as on the CAN bus.
 */
struct vt_classic_emergency_t {
    /**
     * CiA 301 emergency error code; 0: no fault any more
     *
     * Range: 0..65535 (0..65535 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t emcy;

    /**
     * CiA 301 object 0x1001
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t error_register;

    /**
     * our fault code
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t fault;

    /**
     * status bits at this time
     *
     * Range: 0..65535 (0..65535 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t fault_status;
};

/**
 * Signals in message Heartbeat.
 *
 * The node is there; object heartbeat_ms sets the period.
 *
 * All signal values are as on the CAN bus.
 */
struct vt_classic_heartbeat_t {
    /**
     * CiA 301 NMT state
     *
     * Range: 0..127 (0..127 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t nmt_state;
};

/**
 * Pack message Part1.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_classic_part1_pack(
    uint8_t *dst_p,
    const struct vt_classic_part1_t *src_p,
    size_t size);

/**
 * Unpack message Part1.
 *
 * @param[out] dst_p Object to unpack the message into.
 * @param[in] src_p Message to unpack.
 * @param[in] size Size of src_p.
 *
 * @return zero(0) or negative error code.
 */
int vt_classic_part1_unpack(
    struct vt_classic_part1_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from Part1.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_classic_part1_init(struct vt_classic_part1_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part1_crc_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part1_crc_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_crc_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_crc_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part1_counter_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part1_counter_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_counter_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_counter_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part1_version_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part1_version_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_version_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_version_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part1_sample_low_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part1_sample_low_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_sample_low_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_sample_low_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part1_displacement_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part1_displacement_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_displacement_mm_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_displacement_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part1_shear_x_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part1_shear_x_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_shear_x_mm_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_shear_x_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part1_shear_y_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part1_shear_y_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_shear_y_mm_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part1_shear_y_mm_is_in_phys_range(float value);

/**
 * Pack message Part2.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_classic_part2_pack(
    uint8_t *dst_p,
    const struct vt_classic_part2_t *src_p,
    size_t size);

/**
 * Unpack message Part2.
 *
 * @param[out] dst_p Object to unpack the message into.
 * @param[in] src_p Message to unpack.
 * @param[in] size Size of src_p.
 *
 * @return zero(0) or negative error code.
 */
int vt_classic_part2_unpack(
    struct vt_classic_part2_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from Part2.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_classic_part2_init(struct vt_classic_part2_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part2_crc_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part2_crc_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_crc_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_crc_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part2_counter_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part2_counter_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_counter_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_counter_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part2_version_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part2_version_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_version_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_version_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part2_sample_low_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part2_sample_low_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_sample_low_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_sample_low_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_classic_part2_status_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part2_status_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_status_is_in_range(uint16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_status_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_classic_part2_sample_high_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part2_sample_high_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_sample_high_is_in_range(uint16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_sample_high_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part2_pins_tracked_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part2_pins_tracked_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_pins_tracked_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_pins_tracked_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part2_contact_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part2_contact_n_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_contact_n_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_contact_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part2_part_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part2_part_n_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_part_n_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part2_part_n_is_in_phys_range(float value);

/**
 * Pack message Part3.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_classic_part3_pack(
    uint8_t *dst_p,
    const struct vt_classic_part3_t *src_p,
    size_t size);

/**
 * Unpack message Part3.
 *
 * @param[out] dst_p Object to unpack the message into.
 * @param[in] src_p Message to unpack.
 * @param[in] size Size of src_p.
 *
 * @return zero(0) or negative error code.
 */
int vt_classic_part3_unpack(
    struct vt_classic_part3_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from Part3.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_classic_part3_init(struct vt_classic_part3_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_crc_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_crc_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_crc_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_crc_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_counter_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_counter_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_counter_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_counter_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_version_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_version_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_version_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_version_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_sample_low_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_sample_low_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_sample_low_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_sample_low_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_page_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_page_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_page_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_page_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint32_t vt_classic_part3_capture_time_us_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_capture_time_us_decode(uint32_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_capture_time_us_is_in_range(uint32_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_capture_time_us_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_displacement_sigma_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_displacement_sigma_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_displacement_sigma_mm_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_displacement_sigma_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part3_force_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_force_n_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_force_n_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_force_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_classic_part3_contact_area_mm2_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_contact_area_mm2_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_contact_area_mm2_is_in_range(uint16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_contact_area_mm2_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part3_tilt_x_deg_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_tilt_x_deg_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_tilt_x_deg_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_tilt_x_deg_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part3_torsion_deg_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_torsion_deg_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_torsion_deg_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_torsion_deg_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part3_force_x_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_force_x_n_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_force_x_n_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_force_x_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part3_torque_z_nmm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_torque_z_nmm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_torque_z_nmm_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_torque_z_nmm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_shear_sigma_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_shear_sigma_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_shear_sigma_mm_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_shear_sigma_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_classic_part3_latency_us_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_latency_us_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_latency_us_is_in_range(uint16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_latency_us_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part3_pressure_kpa_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_pressure_kpa_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_pressure_kpa_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_pressure_kpa_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_classic_part3_orientation_deg_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_orientation_deg_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_orientation_deg_is_in_range(int8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_orientation_deg_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part3_tilt_y_deg_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_tilt_y_deg_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_tilt_y_deg_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_tilt_y_deg_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_slip_speed_mm_s_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_slip_speed_mm_s_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_slip_speed_mm_s_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_slip_speed_mm_s_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part3_force_y_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_force_y_n_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_force_y_n_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_force_y_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_torque_z_sigma_nmm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_torque_z_sigma_nmm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_torque_z_sigma_nmm_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_torque_z_sigma_nmm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_vibration_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_vibration_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_vibration_mm_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_vibration_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_slip_probability_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_slip_probability_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_slip_probability_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_slip_probability_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_friction_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_friction_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_friction_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_friction_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_check_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_check_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_check_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_check_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_classic_part3_temperature_degc_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_temperature_degc_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_temperature_degc_is_in_range(int8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_temperature_degc_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_twist_slip_probability_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_twist_slip_probability_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_twist_slip_probability_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_twist_slip_probability_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_force_xy_sigma_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_force_xy_sigma_n_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_force_xy_sigma_n_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_force_xy_sigma_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part3_slip_margin_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part3_slip_margin_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_slip_margin_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part3_slip_margin_is_in_phys_range(float value);

/**
 * Pack message Part4.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_classic_part4_pack(
    uint8_t *dst_p,
    const struct vt_classic_part4_t *src_p,
    size_t size);

/**
 * Unpack message Part4.
 *
 * @param[out] dst_p Object to unpack the message into.
 * @param[in] src_p Message to unpack.
 * @param[in] size Size of src_p.
 *
 * @return zero(0) or negative error code.
 */
int vt_classic_part4_unpack(
    struct vt_classic_part4_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from Part4.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_classic_part4_init(struct vt_classic_part4_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part4_crc_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_crc_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_crc_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_crc_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part4_counter_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_counter_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_counter_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_counter_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part4_version_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_version_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_version_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_version_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part4_sample_low_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_sample_low_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_sample_low_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_sample_low_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part4_page_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_page_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_page_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_page_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part4_contact0_x_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_contact0_x_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact0_x_mm_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact0_x_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part4_contact1_x_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_contact1_x_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact1_x_mm_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact1_x_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part4_contact0_y_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_contact0_y_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact0_y_mm_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact0_y_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_classic_part4_contact1_y_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_contact1_y_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact1_y_mm_is_in_range(int16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact1_y_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part4_contact0_depth_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_contact0_depth_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact0_depth_mm_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact0_depth_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_part4_contact1_depth_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_part4_contact1_depth_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact1_depth_mm_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_part4_contact1_depth_mm_is_in_phys_range(float value);

/**
 * Pack message Emergency.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_classic_emergency_pack(
    uint8_t *dst_p,
    const struct vt_classic_emergency_t *src_p,
    size_t size);

/**
 * Unpack message Emergency.
 *
 * @param[out] dst_p Object to unpack the message into.
 * @param[in] src_p Message to unpack.
 * @param[in] size Size of src_p.
 *
 * @return zero(0) or negative error code.
 */
int vt_classic_emergency_unpack(
    struct vt_classic_emergency_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from Emergency.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_classic_emergency_init(struct vt_classic_emergency_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_classic_emergency_emcy_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_emergency_emcy_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_emergency_emcy_is_in_range(uint16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_emergency_emcy_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_emergency_error_register_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_emergency_error_register_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_emergency_error_register_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_emergency_error_register_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_emergency_fault_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_emergency_fault_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_emergency_fault_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_emergency_fault_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_classic_emergency_fault_status_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_emergency_fault_status_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_emergency_fault_status_is_in_range(uint16_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_emergency_fault_status_is_in_phys_range(float value);

/**
 * Pack message Heartbeat.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_classic_heartbeat_pack(
    uint8_t *dst_p,
    const struct vt_classic_heartbeat_t *src_p,
    size_t size);

/**
 * Unpack message Heartbeat.
 *
 * @param[out] dst_p Object to unpack the message into.
 * @param[in] src_p Message to unpack.
 * @param[in] size Size of src_p.
 *
 * @return zero(0) or negative error code.
 */
int vt_classic_heartbeat_unpack(
    struct vt_classic_heartbeat_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from Heartbeat.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_classic_heartbeat_init(struct vt_classic_heartbeat_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_classic_heartbeat_nmt_state_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_classic_heartbeat_nmt_state_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_heartbeat_nmt_state_is_in_range(uint8_t value);

/**
 * Check that given physical value is in allowed range before encoding.
 *
 * Use this BEFORE calling _encode() to avoid silent integer overflow:
 *   encode(-1.0) on a [0,100] signal wraps to 255 and passes is_in_range().
 *   is_in_phys_range(-1.0) correctly returns false.
 *
 * @param[in] value Physical signal value to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_classic_heartbeat_nmt_state_is_in_phys_range(float value);


#ifdef __cplusplus
}
#endif

#endif
