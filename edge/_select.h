/* Order statistics without sorting: Hoare's selection. */
#ifndef EDGE_SELECT_H
#define EDGE_SELECT_H

#include <Python.h>

/* k-th smallest of n > k values; reorders `v`: none before place k is larger, none behind it smaller. */
static double select_kth(double *v, Py_ssize_t n, Py_ssize_t k)
{
    Py_ssize_t low = 0, high = n - 1;
    while (low < high) {
        const double pivot = v[(low + high) / 2];
        Py_ssize_t i = low, j = high;
        while (i <= j) {
            while (v[i] < pivot) i++;
            while (v[j] > pivot) j--;
            if (i <= j) {
                const double t = v[i];
                v[i++] = v[j];
                v[j--] = t;
            }
        }
        if (k <= j) high = j;
        else if (k >= i) low = i;
        else break;
    }
    return v[k];
}

#endif
