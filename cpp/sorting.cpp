// Order of values. A C interface, for Fortran.
#include <algorithm>
#include <cstdint>
#include <numeric>

// Places, from 1, that sort the values, ascending; equal values keep their order.
extern "C" void bayesindent_sort_order(std::int32_t n, const double *values, std::int32_t *order) {
  std::iota(order, order + n, 1);
  std::stable_sort(order, order + n, [values](std::int32_t a, std::int32_t b) { return values[a - 1] < values[b - 1]; });
}
