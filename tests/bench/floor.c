/* The floor under the window centroids: every pixel of every pin's window is read once, where it lies, and added. */
#include <stdint.h>

static inline __attribute__((always_inline)) uint64_t read_one(const uint8_t *row, int64_t row_bytes, int64_t size, int width)
{
    uint16_t column[32] = {0}; /* up to 257 rows of bytes fit */
    uint64_t total = 0;
    for (int64_t y = 0; y < size; y++, row += row_bytes)
        for (int x = 0; x < width; x++) column[x] += row[x];
    for (int x = 0; x < width; x++) total += column[x];
    return total;
}

/* width  8, 16, 24 or 32 columns of each window, size rows */
uint64_t read_windows(const uint8_t *image, int64_t row_bytes, const int32_t *corner, int64_t n, int64_t size, int64_t width)
{
    uint64_t total = 0;
    for (int64_t i = 0; i < n; i++) {
        const uint8_t *from = image + corner[2 * i + 1] * row_bytes + corner[2 * i];
        total += width == 8    ? read_one(from, row_bytes, size, 8)
                 : width == 16 ? read_one(from, row_bytes, size, 16)
                 : width == 24 ? read_one(from, row_bytes, size, 24)
                               : read_one(from, row_bytes, size, 32);
    }
    return total;
}
