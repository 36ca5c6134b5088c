/* voronoi-touch: what receiver.c offers, and what it asks for.
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RECEIVER_H
#define RECEIVER_H

#include <stddef.h>
#include <stdint.h>

#ifndef NODE
#define NODE 1u /* the finger's number on the bus */
#endif

/* Call these when something came in. now_ms: any clock that counts milliseconds; it may wrap. Who reads a queue
 * gives the time at which the frame came in, not that of the reading: after a halt, what waited is old. */
void on_can(uint32_t id, const uint8_t *data, size_t size, uint32_t now_ms);
void on_serial_byte(uint8_t byte, uint32_t now_ms);

/* The control loop calls these. */
float finger_pressed_mm(uint32_t now_ms); /* NAN: not known, so the hand stops */
uint32_t finger_samples_lost(void);
void finger_tare(uint32_t now_ms);
uint8_t finger_tare_outcome(uint32_t now_ms); /* call it in each turn; VT_REST_FRAME_BUSY until it is over */

/* Yours. */
void can_send(uint32_t id, const uint8_t *data, size_t size);
void serial_send(const uint8_t *data, size_t size);

#endif
