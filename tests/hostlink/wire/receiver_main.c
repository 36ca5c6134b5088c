/* Test: receiver.c and the files under it, on a program's stdin and stdout.
 *
 *     in   "can ID HEX MS", "serial HEX MS", "tare MS", "look MS"
 *     out  look: "pressed_mm samples_lost outcome"; what it sends: "can ID HEX", "serial HEX"
 *
 *     in   "part TPDO HEX", "line HEX", "pack TYPE COUNTER HEX"
 *     out  "frame HEX" for each sample put together; "TYPE HEX" for each whole frame; "packed HEX"
 */
#include <stdio.h>
#include <string.h>

#include "examples/receiver.h"
#include "vt_parts.h"
#include "vt_serial.h"

static void say(const char *what, const uint8_t *data, size_t size)
{
    printf("%s ", what);
    for (size_t i = 0u; i < size; i++) {
        printf("%02x", (unsigned)data[i]);
    }
    printf("\n");
    fflush(stdout);
}

void can_send(uint32_t id, const uint8_t *data, size_t size)
{
    char what[32];

    snprintf(what, sizeof what, "can %lx", (unsigned long)id);
    say(what, data, size);
}

void serial_send(const uint8_t *data, size_t size)
{
    say("serial", data, size);
}

static size_t from_hex(const char *text, uint8_t *data, size_t room)
{
    size_t size = 0u;
    unsigned byte;

    while (size < room && sscanf(&text[2u * size], "%2x", &byte) == 1) {
        data[size] = (uint8_t)byte;
        size++;
    }
    return size;
}

int main(void)
{
    static char line[20000];
    static char hex[16000];
    static uint8_t data[8000];
    static uint8_t out[VT_SERIAL_WIRE(VT_SERIAL_BODY_MAX)];
    static vt_parts_t parts;
    static vt_serial_t serial;
    unsigned long id, ms;
    unsigned number, counter;

    while (fgets(line, sizeof line, stdin) != NULL) {
        if (sscanf(line, "can %lx %15999s %lu", &id, hex, &ms) == 3) {
            on_can((uint32_t)id, data, from_hex(hex, data, 64u), (uint32_t)ms);
        } else if (sscanf(line, "serial %15999s %lu", hex, &ms) == 2) {
            const size_t size = from_hex(hex, data, sizeof data);

            for (size_t i = 0u; i < size; i++) {
                on_serial_byte(data[i], (uint32_t)ms);
            }
        } else if (sscanf(line, "tare %lu", &ms) == 1) {
            finger_tare((uint32_t)ms);
        } else if (sscanf(line, "look %lu", &ms) == 1) {
            const double mm = (double)finger_pressed_mm((uint32_t)ms);

            printf("%.6f %lu %u\n", mm, (unsigned long)finger_samples_lost(), (unsigned)finger_tare_outcome((uint32_t)ms));
            fflush(stdout);
        } else if (sscanf(line, "part %u %15999s", &number, hex) == 2) {
            if (vt_parts_add(&parts, number, data, from_hex(hex, data, 64u))) {
                say("frame", parts.frame, VT_STATE_SIZE);
            }
        } else if (sscanf(line, "line %15999s", hex) == 1) {
            const size_t size = from_hex(hex, data, sizeof data);
            vt_frame_t frame;

            for (size_t i = 0u; i < size; i++) {
                if (vt_serial_take(&serial, data[i], &frame)) {
                    char what[8];

                    snprintf(what, sizeof what, "%u", (unsigned)frame.type);
                    say(what, frame.payload, frame.size);
                }
            }
        } else if (sscanf(line, "pack %u %u %15999s", &number, &counter, hex) == 3) {
            const size_t size = hex[0] == '-' ? 0u : from_hex(hex, data, sizeof data);

            say("packed", out, vt_serial_pack((uint8_t)number, (uint8_t)counter, data, size, out, sizeof out));
        } else {
            return 1;
        }
    }
    return 0;
}
