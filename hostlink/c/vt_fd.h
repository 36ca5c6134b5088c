/**
 * @file vt_fd.h
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

#ifndef VT_FD_H
#define VT_FD_H

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
#define VT_FD_STATE_FRAME_ID (0x181u)
#define VT_FD_DETAIL_FRAME_ID (0x481u)
#define VT_FD_EMERGENCY_FRAME_ID (0x81u)
#define VT_FD_HEARTBEAT_FRAME_ID (0x701u)

/* Frame lengths in bytes. */
#define VT_FD_STATE_LENGTH (64u)
#define VT_FD_DETAIL_LENGTH (64u)
#define VT_FD_EMERGENCY_LENGTH (8u)
#define VT_FD_HEARTBEAT_LENGTH (1u)

/* Extended or standard frame types. */
#define VT_FD_STATE_IS_EXTENDED (0)
#define VT_FD_DETAIL_IS_EXTENDED (0)
#define VT_FD_EMERGENCY_IS_EXTENDED (0)
#define VT_FD_HEARTBEAT_IS_EXTENDED (0)

/* Frame cycle times in milliseconds. */
#define VT_FD_HEARTBEAT_CYCLE_TIME_MS (500u)

/* Signal choices. */
#define VT_FD_STATE_LATENCY_US_INVALID_CHOICE (65535u)

#define VT_FD_STATE_PINS_TRACKED_INVALID_CHOICE (255u)

#define VT_FD_STATE_DISPLACEMENT_MM_INVALID_CHOICE (-32768)

#define VT_FD_STATE_DISPLACEMENT_SIGMA_MM_INVALID_CHOICE (255u)

#define VT_FD_STATE_FORCE_N_INVALID_CHOICE (-32768)

#define VT_FD_STATE_FORCE_X_N_INVALID_CHOICE (-32768)

#define VT_FD_STATE_FORCE_Y_N_INVALID_CHOICE (-32768)

#define VT_FD_STATE_FORCE_XY_SIGMA_N_INVALID_CHOICE (255u)

#define VT_FD_STATE_TORQUE_Z_NMM_INVALID_CHOICE (-32768)

#define VT_FD_STATE_TORQUE_Z_SIGMA_NMM_INVALID_CHOICE (255u)

#define VT_FD_STATE_FRICTION_INVALID_CHOICE (255u)

#define VT_FD_STATE_SLIP_MARGIN_INVALID_CHOICE (255u)

#define VT_FD_STATE_PRESSURE_KPA_INVALID_CHOICE (-32768)

#define VT_FD_STATE_CONTACT_AREA_MM2_INVALID_CHOICE (65535u)

#define VT_FD_STATE_SHEAR_X_MM_INVALID_CHOICE (-32768)

#define VT_FD_STATE_SHEAR_Y_MM_INVALID_CHOICE (-32768)

#define VT_FD_STATE_SHEAR_SIGMA_MM_INVALID_CHOICE (255u)

#define VT_FD_STATE_TORSION_DEG_INVALID_CHOICE (-32768)

#define VT_FD_STATE_TILT_X_DEG_INVALID_CHOICE (-32768)

#define VT_FD_STATE_TILT_Y_DEG_INVALID_CHOICE (-32768)

#define VT_FD_STATE_SLIP_SPEED_MM_S_INVALID_CHOICE (255u)

#define VT_FD_STATE_SLIP_PROBABILITY_INVALID_CHOICE (255u)

#define VT_FD_STATE_TWIST_SLIP_PROBABILITY_INVALID_CHOICE (255u)

#define VT_FD_STATE_CONTACT0_X_MM_INVALID_CHOICE (-32768)

#define VT_FD_STATE_CONTACT0_Y_MM_INVALID_CHOICE (-32768)

#define VT_FD_STATE_CONTACT0_DEPTH_MM_INVALID_CHOICE (255u)

#define VT_FD_STATE_CONTACT1_X_MM_INVALID_CHOICE (-32768)

#define VT_FD_STATE_CONTACT1_Y_MM_INVALID_CHOICE (-32768)

#define VT_FD_STATE_CONTACT1_DEPTH_MM_INVALID_CHOICE (255u)

#define VT_FD_STATE_ORIENTATION_DEG_INVALID_CHOICE (-128)

#define VT_FD_STATE_VIBRATION_MM_INVALID_CHOICE (255u)

#define VT_FD_STATE_TEMPERATURE_DEGC_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN0_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN0_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN0_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN1_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN1_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN1_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN2_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN2_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN2_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN3_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN3_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN3_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN4_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN4_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN4_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN5_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN5_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN5_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN6_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN6_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN6_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN7_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN7_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN7_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN8_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN8_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN8_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN9_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN9_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN9_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN10_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN10_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN10_DA_INVALID_CHOICE (-128)

#define VT_FD_DETAIL_PIN11_DX_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN11_DY_PX_INVALID_CHOICE (-8192)

#define VT_FD_DETAIL_PIN11_DA_INVALID_CHOICE (-128)

#define VT_FD_EMERGENCY_EMCY_NONE_CHOICE (0u)
#define VT_FD_EMERGENCY_EMCY_OVER_TEMPERATURE_CHOICE (16897u)
#define VT_FD_EMERGENCY_EMCY_CAMERA_LOST_CHOICE (20481u)
#define VT_FD_EMERGENCY_EMCY_CAMERA_STALLED_CHOICE (20482u)
#define VT_FD_EMERGENCY_EMCY_IMAGE_DARK_CHOICE (20483u)
#define VT_FD_EMERGENCY_EMCY_IMAGE_BRIGHT_CHOICE (20484u)
#define VT_FD_EMERGENCY_EMCY_IMAGE_BLURRED_CHOICE (20485u)
#define VT_FD_EMERGENCY_EMCY_CAMERA_MOVED_CHOICE (20486u)
#define VT_FD_EMERGENCY_EMCY_DISK_FULL_CHOICE (24577u)
#define VT_FD_EMERGENCY_EMCY_CLOCK_STEP_CHOICE (24578u)
#define VT_FD_EMERGENCY_EMCY_TRACKER_LOST_CHOICE (24833u)
#define VT_FD_EMERGENCY_EMCY_CALIBRATION_MISSING_CHOICE (25345u)
#define VT_FD_EMERGENCY_EMCY_CALIBRATION_FOREIGN_CHOICE (25346u)
#define VT_FD_EMERGENCY_EMCY_TARE_IMPLAUSIBLE_CHOICE (25347u)
#define VT_FD_EMERGENCY_EMCY_LINK_DOWN_CHOICE (33025u)
#define VT_FD_EMERGENCY_EMCY_BUS_OFF_CHOICE (33088u)
#define VT_FD_EMERGENCY_EMCY_PINS_LOST_CHOICE (36865u)
#define VT_FD_EMERGENCY_EMCY_OVERLOAD_CHOICE (36866u)

#define VT_FD_EMERGENCY_FAULT_NONE_CHOICE (0u)
#define VT_FD_EMERGENCY_FAULT_CAMERA_LOST_CHOICE (1u)
#define VT_FD_EMERGENCY_FAULT_CAMERA_STALLED_CHOICE (2u)
#define VT_FD_EMERGENCY_FAULT_IMAGE_DARK_CHOICE (3u)
#define VT_FD_EMERGENCY_FAULT_IMAGE_BRIGHT_CHOICE (4u)
#define VT_FD_EMERGENCY_FAULT_IMAGE_BLURRED_CHOICE (5u)
#define VT_FD_EMERGENCY_FAULT_CAMERA_MOVED_CHOICE (6u)
#define VT_FD_EMERGENCY_FAULT_PINS_LOST_CHOICE (7u)
#define VT_FD_EMERGENCY_FAULT_TRACKER_LOST_CHOICE (8u)
#define VT_FD_EMERGENCY_FAULT_CALIBRATION_MISSING_CHOICE (9u)
#define VT_FD_EMERGENCY_FAULT_CALIBRATION_FOREIGN_CHOICE (10u)
#define VT_FD_EMERGENCY_FAULT_TARE_IMPLAUSIBLE_CHOICE (11u)
#define VT_FD_EMERGENCY_FAULT_OVERLOAD_CHOICE (12u)
#define VT_FD_EMERGENCY_FAULT_LINK_DOWN_CHOICE (13u)
#define VT_FD_EMERGENCY_FAULT_BUS_OFF_CHOICE (14u)
#define VT_FD_EMERGENCY_FAULT_DISK_FULL_CHOICE (15u)
#define VT_FD_EMERGENCY_FAULT_CLOCK_STEP_CHOICE (16u)
#define VT_FD_EMERGENCY_FAULT_OVER_TEMPERATURE_CHOICE (17u)

#define VT_FD_HEARTBEAT_NMT_STATE_BOOT_UP_CHOICE (0u)
#define VT_FD_HEARTBEAT_NMT_STATE_STOPPED_CHOICE (4u)
#define VT_FD_HEARTBEAT_NMT_STATE_OPERATIONAL_CHOICE (5u)
#define VT_FD_HEARTBEAT_NMT_STATE_PRE_OPERATIONAL_CHOICE (127u)

/* Frame Names. */
#define VT_FD_STATE_NAME "State"
#define VT_FD_DETAIL_NAME "Detail"
#define VT_FD_EMERGENCY_NAME "Emergency"
#define VT_FD_HEARTBEAT_NAME "Heartbeat"

/* Signal Names. */
#define VT_FD_STATE_CRC_NAME "crc"
#define VT_FD_STATE_COUNTER_NAME "counter"
#define VT_FD_STATE_VERSION_NAME "version"
#define VT_FD_STATE_SAMPLE_NAME "sample"
#define VT_FD_STATE_STATUS_NAME "status"
#define VT_FD_STATE_CAPTURE_TIME_US_NAME "capture_time_us"
#define VT_FD_STATE_LATENCY_US_NAME "latency_us"
#define VT_FD_STATE_PINS_TRACKED_NAME "pins_tracked"
#define VT_FD_STATE_CONTACT_N_NAME "contact_n"
#define VT_FD_STATE_DISPLACEMENT_MM_NAME "displacement_mm"
#define VT_FD_STATE_DISPLACEMENT_SIGMA_MM_NAME "displacement_sigma_mm"
#define VT_FD_STATE_FORCE_N_NAME "force_n"
#define VT_FD_STATE_FORCE_X_N_NAME "force_x_n"
#define VT_FD_STATE_FORCE_Y_N_NAME "force_y_n"
#define VT_FD_STATE_FORCE_XY_SIGMA_N_NAME "force_xy_sigma_n"
#define VT_FD_STATE_TORQUE_Z_NMM_NAME "torque_z_nmm"
#define VT_FD_STATE_TORQUE_Z_SIGMA_NMM_NAME "torque_z_sigma_nmm"
#define VT_FD_STATE_FRICTION_NAME "friction"
#define VT_FD_STATE_SLIP_MARGIN_NAME "slip_margin"
#define VT_FD_STATE_PRESSURE_KPA_NAME "pressure_kpa"
#define VT_FD_STATE_CONTACT_AREA_MM2_NAME "contact_area_mm2"
#define VT_FD_STATE_SHEAR_X_MM_NAME "shear_x_mm"
#define VT_FD_STATE_SHEAR_Y_MM_NAME "shear_y_mm"
#define VT_FD_STATE_SHEAR_SIGMA_MM_NAME "shear_sigma_mm"
#define VT_FD_STATE_TORSION_DEG_NAME "torsion_deg"
#define VT_FD_STATE_TILT_X_DEG_NAME "tilt_x_deg"
#define VT_FD_STATE_TILT_Y_DEG_NAME "tilt_y_deg"
#define VT_FD_STATE_SLIP_SPEED_MM_S_NAME "slip_speed_mm_s"
#define VT_FD_STATE_SLIP_PROBABILITY_NAME "slip_probability"
#define VT_FD_STATE_TWIST_SLIP_PROBABILITY_NAME "twist_slip_probability"
#define VT_FD_STATE_CONTACT0_X_MM_NAME "contact0_x_mm"
#define VT_FD_STATE_CONTACT0_Y_MM_NAME "contact0_y_mm"
#define VT_FD_STATE_CONTACT0_DEPTH_MM_NAME "contact0_depth_mm"
#define VT_FD_STATE_CONTACT1_X_MM_NAME "contact1_x_mm"
#define VT_FD_STATE_CONTACT1_Y_MM_NAME "contact1_y_mm"
#define VT_FD_STATE_CONTACT1_DEPTH_MM_NAME "contact1_depth_mm"
#define VT_FD_STATE_ORIENTATION_DEG_NAME "orientation_deg"
#define VT_FD_STATE_VIBRATION_MM_NAME "vibration_mm"
#define VT_FD_STATE_TEMPERATURE_DEGC_NAME "temperature_degc"
#define VT_FD_STATE_CHECK_NAME "check"
#define VT_FD_DETAIL_CRC_NAME "crc"
#define VT_FD_DETAIL_COUNTER_NAME "counter"
#define VT_FD_DETAIL_VERSION_NAME "version"
#define VT_FD_DETAIL_SAMPLE_NAME "sample"
#define VT_FD_DETAIL_SEGMENT_NAME "segment"
#define VT_FD_DETAIL_SEGMENT_N_NAME "segment_n"
#define VT_FD_DETAIL_PIN_N_NAME "pin_n"
#define VT_FD_DETAIL_PIN0_DX_PX_NAME "pin0_dx_px"
#define VT_FD_DETAIL_PIN0_DY_PX_NAME "pin0_dy_px"
#define VT_FD_DETAIL_PIN0_DA_NAME "pin0_da"
#define VT_FD_DETAIL_PIN1_DX_PX_NAME "pin1_dx_px"
#define VT_FD_DETAIL_PIN1_DY_PX_NAME "pin1_dy_px"
#define VT_FD_DETAIL_PIN1_DA_NAME "pin1_da"
#define VT_FD_DETAIL_PIN2_DX_PX_NAME "pin2_dx_px"
#define VT_FD_DETAIL_PIN2_DY_PX_NAME "pin2_dy_px"
#define VT_FD_DETAIL_PIN2_DA_NAME "pin2_da"
#define VT_FD_DETAIL_PIN3_DX_PX_NAME "pin3_dx_px"
#define VT_FD_DETAIL_PIN3_DY_PX_NAME "pin3_dy_px"
#define VT_FD_DETAIL_PIN3_DA_NAME "pin3_da"
#define VT_FD_DETAIL_PIN4_DX_PX_NAME "pin4_dx_px"
#define VT_FD_DETAIL_PIN4_DY_PX_NAME "pin4_dy_px"
#define VT_FD_DETAIL_PIN4_DA_NAME "pin4_da"
#define VT_FD_DETAIL_PIN5_DX_PX_NAME "pin5_dx_px"
#define VT_FD_DETAIL_PIN5_DY_PX_NAME "pin5_dy_px"
#define VT_FD_DETAIL_PIN5_DA_NAME "pin5_da"
#define VT_FD_DETAIL_PIN6_DX_PX_NAME "pin6_dx_px"
#define VT_FD_DETAIL_PIN6_DY_PX_NAME "pin6_dy_px"
#define VT_FD_DETAIL_PIN6_DA_NAME "pin6_da"
#define VT_FD_DETAIL_PIN7_DX_PX_NAME "pin7_dx_px"
#define VT_FD_DETAIL_PIN7_DY_PX_NAME "pin7_dy_px"
#define VT_FD_DETAIL_PIN7_DA_NAME "pin7_da"
#define VT_FD_DETAIL_PIN8_DX_PX_NAME "pin8_dx_px"
#define VT_FD_DETAIL_PIN8_DY_PX_NAME "pin8_dy_px"
#define VT_FD_DETAIL_PIN8_DA_NAME "pin8_da"
#define VT_FD_DETAIL_PIN9_DX_PX_NAME "pin9_dx_px"
#define VT_FD_DETAIL_PIN9_DY_PX_NAME "pin9_dy_px"
#define VT_FD_DETAIL_PIN9_DA_NAME "pin9_da"
#define VT_FD_DETAIL_PIN10_DX_PX_NAME "pin10_dx_px"
#define VT_FD_DETAIL_PIN10_DY_PX_NAME "pin10_dy_px"
#define VT_FD_DETAIL_PIN10_DA_NAME "pin10_da"
#define VT_FD_DETAIL_PIN11_DX_PX_NAME "pin11_dx_px"
#define VT_FD_DETAIL_PIN11_DY_PX_NAME "pin11_dy_px"
#define VT_FD_DETAIL_PIN11_DA_NAME "pin11_da"
#define VT_FD_EMERGENCY_EMCY_NAME "emcy"
#define VT_FD_EMERGENCY_ERROR_REGISTER_NAME "error_register"
#define VT_FD_EMERGENCY_FAULT_NAME "fault"
#define VT_FD_EMERGENCY_FAULT_STATUS_NAME "fault_status"
#define VT_FD_HEARTBEAT_NMT_STATE_NAME "nmt_state"

/**
 * Signals in message State.
 *
 * One sample. Check crc and version, then status; then take values that are not invalid.
 *
 * All signal values are as on the CAN bus.
 */
struct vt_fd_state_t {
    /**
     * E2E profile 5 CRC-16 over the rest and the data id
     *
     * Range: 0..65535 (0..65535 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t crc;

    /**
     * E2E counter
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t counter;

    /**
     * layout version, 4 here; check before use
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t version;

    /**
     * sample number; counts up by one with every measurement, wraps to 0
     *
     * Range: 0..65535 (0..65535 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t sample;

    /**
     * status bits, see the table of status bits
     *
     * Range: 0..65535 (0..65535 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t status;

    /**
     * start of exposure on the sensor's monotonic clock; wraps to 0 after 71.6 minutes
     *
     * Range: 0..4294967295 (0..4294967295 us)
     * Scale: 1
     * Offset: 0
     */
    uint32_t capture_time_us;

    /**
     * time from capture to sending of this sample
     *
     * Range: 0..65534 (0..655340 us)
     * Scale: 10
     * Offset: 0
     */
    uint16_t latency_us;

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
     * depth by which the skin is pressed in, along z; positive is into the tip
     *
     * Range: -8000..8000 (-16..16 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t displacement_mm;

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
     * friction force on the tip along x (tip frame): what drags the skin towards x is positive
     *
     * Range: -32500..32500 (-65..65 N)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t force_x_n;

    /**
     * friction force on the tip along y (tip frame)
     *
     * Range: -32500..32500 (-65..65 N)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t force_y_n;

    /**
     * standard deviation of force_x_n and of force_y_n
     *
     * Range: 0..254 (0..2.54 N)
     * Scale: 0.01
     * Offset: 0
     */
    uint8_t force_xy_sigma_n;

    /**
     * torque of the friction on the tip about z, positive from x to y
     *
     * Range: -32000..32000 (-640..640 Nmm)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t torque_z_nmm;

    /**
     * standard deviation of the torque
     *
     * Range: 0..254 (0..25.4 Nmm)
     * Scale: 0.1
     * Offset: 0
     */
    uint8_t torque_z_sigma_nmm;

    /**
     * largest tangential over normal load that this contact has held, its torque included
     *
     * Range: 0..254 (0..5.08 -)
     * Scale: 0.02
     * Offset: 0
     */
    uint8_t friction;

    /**
     * 1 less the present tangential over normal load in units of `friction`; 0: nothing more has been held; not known before the first tangential load of a contact
     *
     * Range: 0..250 (0..1 -)
     * Scale: 0.004
     * Offset: 0
     */
    uint8_t slip_margin;

    /**
     * force over contact area
     *
     * Range: -32000..32000 (-1600..1600 kPa)
     * Scale: 0.05
     * Offset: 0
     */
    int16_t pressure_kpa;

    /**
     * area of skin in contact, all contacts together
     *
     * Range: 0..65500 (0..1310 mm2)
     * Scale: 0.02
     * Offset: 0
     */
    uint16_t contact_area_mm2;

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

    /**
     * standard deviation of each axis of the shear
     *
     * Range: 0..254 (0..2.032 mm)
     * Scale: 0.008
     * Offset: 0
     */
    uint8_t shear_sigma_mm;

    /**
     * twist of the contact about z, positive from x to y
     *
     * Range: -18000..18000 (-180..180 deg)
     * Scale: 0.01
     * Offset: 0
     */
    int16_t torsion_deg;

    /**
     * tilt of the touched surface about x, right-handed
     *
     * Range: -18000..18000 (-180..180 deg)
     * Scale: 0.01
     * Offset: 0
     */
    int16_t tilt_x_deg;

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
     * probability that more than a third of the contact's area slides, 0..1; slip begins at the rim
     *
     * Range: 0..250 (0..1 -)
     * Scale: 0.004
     * Offset: 0
     */
    uint8_t slip_probability;

    /**
     * the same of a twist alone, 0..1; slip_probability is the larger one of twist and drag
     *
     * Range: 0..250 (0..1 -)
     * Scale: 0.004
     * Offset: 0
     */
    uint8_t twist_slip_probability;

    /**
     * place of contact 0, x (tip frame)
     *
     * Range: -32500..32500 (-65..65 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t contact0_x_mm;

    /**
     * place of contact 0, y (tip frame)
     *
     * Range: -32500..32500 (-65..65 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t contact0_y_mm;

    /**
     * depth of contact 0 into the skin
     *
     * Range: 0..254 (0..6.35 mm)
     * Scale: 0.025
     * Offset: 0
     */
    uint8_t contact0_depth_mm;

    /**
     * place of contact 1, x (tip frame)
     *
     * Range: -32500..32500 (-65..65 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t contact1_x_mm;

    /**
     * place of contact 1, y (tip frame)
     *
     * Range: -32500..32500 (-65..65 mm)
     * Scale: 0.002
     * Offset: 0
     */
    int16_t contact1_y_mm;

    /**
     * depth of contact 1 into the skin
     *
     * Range: 0..254 (0..6.35 mm)
     * Scale: 0.025
     * Offset: 0
     */
    uint8_t contact1_depth_mm;

    /**
     * direction of the long axis of the contact (edge), from x towards y, in (-90, 90]
     *
     * Range: -120..120 (-90..90 deg)
     * Scale: 0.75
     * Offset: 0
     */
    int8_t orientation_deg;

    /**
     * rms motion of the contact's pins above 10 Hz, up to half the rate of images; 0: no contact
     *
     * Range: 0..254 (0..0.508 mm)
     * Scale: 0.002
     * Offset: 0
     */
    uint8_t vibration_mm;

    /**
     * temperature of the board
     *
     * Range: -40..125 (-40..125 degC)
     * Scale: 1.0
     * Offset: 0
     */
    int8_t temperature_degc;

    /**
     * low half of the CRC-32 over bytes 3..61
     *
     * Range: 0..65535 (0..65535 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t check;
};

/**
 * Signals in message Detail.
 *
 * Every pin's motion, 12 pins a message, while object detail_divider is not 0.
 *
 * All signal values are as on the CAN bus.
 */
struct vt_fd_detail_t {
    /**
     * E2E profile 5 CRC-16 over the rest and the data id
     *
     * Range: 0..65535 (0..65535 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t crc;

    /**
     * E2E counter
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t counter;

    /**
     * layout version, 4 here; check before use
     *
     * Range: 0..255 (0..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t version;

    /**
     * sample number of the state it belongs to
     *
     * Range: 0..65535 (0..65535 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t sample;

    /**
     * number of this segment; holds pins from 12 * segment on
     *
     * Range: 0..254 (0..254 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t segment;

    /**
     * segments of this sample
     *
     * Range: 1..255 (1..255 -)
     * Scale: 1
     * Offset: 0
     */
    uint8_t segment_n;

    /**
     * pins of this sample
     *
     * Range: 0..3060 (0..3060 -)
     * Scale: 1
     * Offset: 0
     */
    uint16_t pin_n;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin0_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin0_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin0_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin1_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin1_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin1_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin2_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin2_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin2_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin3_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin3_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin3_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin4_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin4_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin4_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin5_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin5_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin5_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin6_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin6_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin6_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin7_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin7_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin7_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin8_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin8_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin8_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin9_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin9_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin9_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin10_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin10_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin10_da;

    /**
     * displacement along x
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin11_dx_px;

    /**
     * displacement along y
     *
     * Range: -8191..8191 (-163.82..163.82 px)
     * Scale: 0.02
     * Offset: 0
     */
    int16_t pin11_dy_px;

    /**
     * relative change of the cell's area
     *
     * Range: -127..127 (-1.27..1.27 -)
     * Scale: 0.01
     * Offset: 0
     */
    int8_t pin11_da;
};

/**
 * Signals in message Emergency.
 *
 * A fault has appeared or cleared.
 *
 * All signal values are as on the CAN bus.
 */
struct vt_fd_emergency_t {
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
struct vt_fd_heartbeat_t {
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
 * Pack message State.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_fd_state_pack(
    uint8_t *dst_p,
    const struct vt_fd_state_t *src_p,
    size_t size);

/**
 * Unpack message State.
 *
 * @param[out] dst_p Object to unpack the message into.
 * @param[in] src_p Message to unpack.
 * @param[in] size Size of src_p.
 *
 * @return zero(0) or negative error code.
 */
int vt_fd_state_unpack(
    struct vt_fd_state_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from State.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_fd_state_init(struct vt_fd_state_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_state_crc_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_crc_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_crc_is_in_range(uint16_t value);

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
bool vt_fd_state_crc_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_counter_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_counter_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_counter_is_in_range(uint8_t value);

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
bool vt_fd_state_counter_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_version_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_version_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_version_is_in_range(uint8_t value);

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
bool vt_fd_state_version_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_state_sample_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_sample_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_sample_is_in_range(uint16_t value);

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
bool vt_fd_state_sample_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_state_status_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_status_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_status_is_in_range(uint16_t value);

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
bool vt_fd_state_status_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint32_t vt_fd_state_capture_time_us_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_capture_time_us_decode(uint32_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_capture_time_us_is_in_range(uint32_t value);

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
bool vt_fd_state_capture_time_us_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_state_latency_us_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_latency_us_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_latency_us_is_in_range(uint16_t value);

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
bool vt_fd_state_latency_us_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_pins_tracked_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_pins_tracked_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_pins_tracked_is_in_range(uint8_t value);

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
bool vt_fd_state_pins_tracked_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_contact_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_contact_n_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_contact_n_is_in_range(uint8_t value);

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
bool vt_fd_state_contact_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_displacement_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_displacement_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_displacement_mm_is_in_range(int16_t value);

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
bool vt_fd_state_displacement_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_displacement_sigma_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_displacement_sigma_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_displacement_sigma_mm_is_in_range(uint8_t value);

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
bool vt_fd_state_displacement_sigma_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_force_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_force_n_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_force_n_is_in_range(int16_t value);

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
bool vt_fd_state_force_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_force_x_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_force_x_n_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_force_x_n_is_in_range(int16_t value);

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
bool vt_fd_state_force_x_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_force_y_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_force_y_n_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_force_y_n_is_in_range(int16_t value);

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
bool vt_fd_state_force_y_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_force_xy_sigma_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_force_xy_sigma_n_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_force_xy_sigma_n_is_in_range(uint8_t value);

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
bool vt_fd_state_force_xy_sigma_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_torque_z_nmm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_torque_z_nmm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_torque_z_nmm_is_in_range(int16_t value);

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
bool vt_fd_state_torque_z_nmm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_torque_z_sigma_nmm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_torque_z_sigma_nmm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_torque_z_sigma_nmm_is_in_range(uint8_t value);

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
bool vt_fd_state_torque_z_sigma_nmm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_friction_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_friction_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_friction_is_in_range(uint8_t value);

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
bool vt_fd_state_friction_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_slip_margin_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_slip_margin_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_slip_margin_is_in_range(uint8_t value);

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
bool vt_fd_state_slip_margin_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_pressure_kpa_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_pressure_kpa_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_pressure_kpa_is_in_range(int16_t value);

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
bool vt_fd_state_pressure_kpa_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_state_contact_area_mm2_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_contact_area_mm2_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_contact_area_mm2_is_in_range(uint16_t value);

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
bool vt_fd_state_contact_area_mm2_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_shear_x_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_shear_x_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_shear_x_mm_is_in_range(int16_t value);

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
bool vt_fd_state_shear_x_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_shear_y_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_shear_y_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_shear_y_mm_is_in_range(int16_t value);

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
bool vt_fd_state_shear_y_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_shear_sigma_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_shear_sigma_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_shear_sigma_mm_is_in_range(uint8_t value);

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
bool vt_fd_state_shear_sigma_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_torsion_deg_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_torsion_deg_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_torsion_deg_is_in_range(int16_t value);

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
bool vt_fd_state_torsion_deg_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_tilt_x_deg_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_tilt_x_deg_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_tilt_x_deg_is_in_range(int16_t value);

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
bool vt_fd_state_tilt_x_deg_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_tilt_y_deg_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_tilt_y_deg_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_tilt_y_deg_is_in_range(int16_t value);

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
bool vt_fd_state_tilt_y_deg_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_slip_speed_mm_s_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_slip_speed_mm_s_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_slip_speed_mm_s_is_in_range(uint8_t value);

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
bool vt_fd_state_slip_speed_mm_s_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_slip_probability_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_slip_probability_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_slip_probability_is_in_range(uint8_t value);

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
bool vt_fd_state_slip_probability_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_twist_slip_probability_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_twist_slip_probability_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_twist_slip_probability_is_in_range(uint8_t value);

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
bool vt_fd_state_twist_slip_probability_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_contact0_x_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_contact0_x_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_contact0_x_mm_is_in_range(int16_t value);

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
bool vt_fd_state_contact0_x_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_contact0_y_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_contact0_y_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_contact0_y_mm_is_in_range(int16_t value);

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
bool vt_fd_state_contact0_y_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_contact0_depth_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_contact0_depth_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_contact0_depth_mm_is_in_range(uint8_t value);

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
bool vt_fd_state_contact0_depth_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_contact1_x_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_contact1_x_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_contact1_x_mm_is_in_range(int16_t value);

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
bool vt_fd_state_contact1_x_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_state_contact1_y_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_contact1_y_mm_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_contact1_y_mm_is_in_range(int16_t value);

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
bool vt_fd_state_contact1_y_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_contact1_depth_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_contact1_depth_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_contact1_depth_mm_is_in_range(uint8_t value);

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
bool vt_fd_state_contact1_depth_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_state_orientation_deg_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_orientation_deg_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_orientation_deg_is_in_range(int8_t value);

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
bool vt_fd_state_orientation_deg_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_state_vibration_mm_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_vibration_mm_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_vibration_mm_is_in_range(uint8_t value);

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
bool vt_fd_state_vibration_mm_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_state_temperature_degc_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_temperature_degc_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_temperature_degc_is_in_range(int8_t value);

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
bool vt_fd_state_temperature_degc_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_state_check_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_state_check_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_state_check_is_in_range(uint16_t value);

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
bool vt_fd_state_check_is_in_phys_range(float value);

/**
 * Pack message Detail.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_fd_detail_pack(
    uint8_t *dst_p,
    const struct vt_fd_detail_t *src_p,
    size_t size);

/**
 * Unpack message Detail.
 *
 * @param[out] dst_p Object to unpack the message into.
 * @param[in] src_p Message to unpack.
 * @param[in] size Size of src_p.
 *
 * @return zero(0) or negative error code.
 */
int vt_fd_detail_unpack(
    struct vt_fd_detail_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from Detail.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_fd_detail_init(struct vt_fd_detail_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_detail_crc_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_crc_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_crc_is_in_range(uint16_t value);

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
bool vt_fd_detail_crc_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_detail_counter_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_counter_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_counter_is_in_range(uint8_t value);

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
bool vt_fd_detail_counter_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_detail_version_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_version_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_version_is_in_range(uint8_t value);

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
bool vt_fd_detail_version_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_detail_sample_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_sample_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_sample_is_in_range(uint16_t value);

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
bool vt_fd_detail_sample_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_detail_segment_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_segment_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_segment_is_in_range(uint8_t value);

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
bool vt_fd_detail_segment_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_detail_segment_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_segment_n_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_segment_n_is_in_range(uint8_t value);

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
bool vt_fd_detail_segment_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_detail_pin_n_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin_n_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin_n_is_in_range(uint16_t value);

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
bool vt_fd_detail_pin_n_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin0_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin0_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin0_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin0_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin0_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin0_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin0_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin0_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin0_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin0_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin0_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin0_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin1_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin1_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin1_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin1_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin1_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin1_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin1_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin1_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin1_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin1_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin1_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin1_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin2_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin2_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin2_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin2_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin2_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin2_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin2_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin2_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin2_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin2_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin2_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin2_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin3_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin3_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin3_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin3_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin3_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin3_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin3_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin3_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin3_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin3_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin3_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin3_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin4_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin4_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin4_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin4_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin4_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin4_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin4_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin4_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin4_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin4_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin4_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin4_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin5_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin5_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin5_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin5_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin5_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin5_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin5_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin5_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin5_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin5_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin5_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin5_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin6_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin6_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin6_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin6_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin6_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin6_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin6_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin6_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin6_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin6_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin6_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin6_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin7_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin7_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin7_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin7_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin7_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin7_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin7_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin7_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin7_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin7_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin7_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin7_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin8_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin8_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin8_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin8_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin8_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin8_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin8_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin8_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin8_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin8_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin8_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin8_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin9_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin9_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin9_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin9_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin9_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin9_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin9_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin9_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin9_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin9_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin9_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin9_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin10_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin10_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin10_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin10_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin10_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin10_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin10_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin10_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin10_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin10_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin10_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin10_da_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin11_dx_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin11_dx_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin11_dx_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin11_dx_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int16_t vt_fd_detail_pin11_dy_px_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin11_dy_px_decode(int16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin11_dy_px_is_in_range(int16_t value);

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
bool vt_fd_detail_pin11_dy_px_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
int8_t vt_fd_detail_pin11_da_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_detail_pin11_da_decode(int8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_detail_pin11_da_is_in_range(int8_t value);

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
bool vt_fd_detail_pin11_da_is_in_phys_range(float value);

/**
 * Pack message Emergency.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_fd_emergency_pack(
    uint8_t *dst_p,
    const struct vt_fd_emergency_t *src_p,
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
int vt_fd_emergency_unpack(
    struct vt_fd_emergency_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from Emergency.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_fd_emergency_init(struct vt_fd_emergency_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_emergency_emcy_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_emergency_emcy_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_emergency_emcy_is_in_range(uint16_t value);

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
bool vt_fd_emergency_emcy_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_emergency_error_register_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_emergency_error_register_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_emergency_error_register_is_in_range(uint8_t value);

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
bool vt_fd_emergency_error_register_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_emergency_fault_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_emergency_fault_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_emergency_fault_is_in_range(uint8_t value);

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
bool vt_fd_emergency_fault_is_in_phys_range(float value);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint16_t vt_fd_emergency_fault_status_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_emergency_fault_status_decode(uint16_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_emergency_fault_status_is_in_range(uint16_t value);

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
bool vt_fd_emergency_fault_status_is_in_phys_range(float value);

/**
 * Pack message Heartbeat.
 *
 * @param[out] dst_p Buffer to pack the message into.
 * @param[in] src_p Data to pack.
 * @param[in] size Size of dst_p.
 *
 * @return Size of packed data, or negative error code.
 */
int vt_fd_heartbeat_pack(
    uint8_t *dst_p,
    const struct vt_fd_heartbeat_t *src_p,
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
int vt_fd_heartbeat_unpack(
    struct vt_fd_heartbeat_t *dst_p,
    const uint8_t *src_p,
    size_t size);

/**
 * Init message fields to default values from Heartbeat.
 *
 * @param[in] msg_p Message to init.
 *
 * @return zero(0) on success or (-1) in case of nullptr argument.
 */
int vt_fd_heartbeat_init(struct vt_fd_heartbeat_t *msg_p);

/**
 * Encode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to encode.
 *
 * @return Encoded signal.
 */
uint8_t vt_fd_heartbeat_nmt_state_encode(float value);

/**
 * Decode given signal by applying scaling and offset.
 *
 * @param[in] value Signal to decode.
 *
 * @return Decoded signal.
 */
float vt_fd_heartbeat_nmt_state_decode(uint8_t value);

/**
 * Check that given signal is in allowed range.
 *
 * @param[in] value Signal to check.
 *
 * @return true if in range, false otherwise.
 */
bool vt_fd_heartbeat_nmt_state_is_in_range(uint8_t value);

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
bool vt_fd_heartbeat_nmt_state_is_in_phys_range(float value);


#ifdef __cplusplus
}
#endif

#endif
