// Order of values, and equality of points. A C interface for Fortran.
#include <algorithm>
#include <cstdint>
#include <map>
#include <numeric>
#include <vector>

// Indices, from 1, that sort the values in ascending order; equal values keep their order.
extern "C" void bayesindent_sort_order(std::int32_t n, const double *values, std::int32_t *order) {
  std::iota(order, order + n, 1);
  std::stable_sort(order, order + n, [values](std::int32_t a, std::int32_t b) {
    return values[a - 1] < values[b - 1];
  });
}

// For each of n points, the number, from 1, of the first point whose coordinates are all equal.
extern "C" void bayesindent_number_equal(std::int32_t coordinates, std::int32_t n,
                                         const double *points, std::int32_t *numbers) {
  std::map<std::vector<double>, std::int32_t> first;
  for (std::int32_t i = 0; i < n; ++i, points += coordinates)
    numbers[i] = first.try_emplace({points, points + coordinates}, i + 1).first->second;
}
