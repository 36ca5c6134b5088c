/* voronoi-touch: gentle grip, as docs/examples/gentle_grip.py has it. An example to copy from.
 * SPDX-License-Identifier: Apache-2.0
 *
 * Closes until the skin is pressed in by DEPTH_MM, and further only while the slip margin is small. One grip_t for
 * each finger, all zeros at the start; call grip_speed_mm_s() with each frame that vt_check() and vt_order() took.
 * Link with vt_fd.c.
 */
#include <math.h>
#include <stdbool.h>

#include "../vt_e2e.h"
#include "../vt_fd.h"

#define DEPTH_MM 0.8f
#define SPEED_MM_S 2.0f
#define MARGIN 0.2f
#define FRICTION 0.6f /* taken for granted; what the object has is not known before it was dragged */

typedef struct {
    bool held;
} grip_t;

float grip_speed_mm_s(grip_t *grip, const uint8_t *frame);

/* Speed of closing, mm/s; 0: stay. */
float grip_speed_mm_s(grip_t *grip, const uint8_t *frame)
{
    struct vt_fd_state_t s;
    float known = FRICTION, load = NAN; /* friction that the contact has; what it carries of its normal force */
    float at_most_mm = NAN;             /* depth, with a sigma that is large if the touch is not known */

    if ((vt_fd_state_unpack(&s, frame, VT_STATE_SIZE) != 0) ||
        ((s.status & (VT_STATUS_NO_CONTROL | VT_STATUS_OVERLOAD)) != 0u)) {
        return 0.0f;
    }
    if (!grip->held) {
        if (vt_fd_state_displacement_mm_is_in_range(s.displacement_mm) &&
            vt_fd_state_displacement_sigma_mm_is_in_range(s.displacement_sigma_mm)) {
            at_most_mm = vt_fd_state_displacement_mm_decode(s.displacement_mm) +
                         2.0f * vt_fd_state_displacement_sigma_mm_decode(s.displacement_sigma_mm);
        }
        grip->held = at_most_mm >= DEPTH_MM;
        return (at_most_mm < DEPTH_MM) ? SPEED_MM_S : 0.0f; /* NAN compares as false: then it waits */
    }
    if (vt_fd_state_friction_is_in_range(s.friction) && vt_fd_state_slip_margin_is_in_range(s.slip_margin)) {
        load = vt_fd_state_friction_decode(s.friction) * (1.0f - vt_fd_state_slip_margin_decode(s.slip_margin));
        known = fmaxf(known, vt_fd_state_friction_decode(s.friction));
    }
    return (load > (1.0f - MARGIN) * known) ? SPEED_MM_S : 0.0f; /* NAN compares as false */
}
