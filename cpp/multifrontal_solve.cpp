// What is read off a factor: its trailing block, and solutions.
#include "multifrontal.h"

#include <algorithm>

namespace bayesindent {

void analysis::kept_factor(const workspace &work, double *factor) const {
  const integer offset = n - kept;
  std::fill(factor, factor + static_cast<std::size_t>(kept) * kept, 0.0);
  for (integer k = supernodes - 1; k >= 0 && first[k + 1] > offset; --k) {
    const integer height = rows_of(k);
    for (integer j = std::max(first[k], offset); j < first[k + 1]; ++j) {
      const real *column = work.arena.get() + block_start[k] + static_cast<std::size_t>(j - first[k]) * height;
      for (integer i = j - first[k]; i < height; ++i)
        factor[static_cast<std::size_t>(j - offset) * kept + rows[row_start[k] + i] - offset] = column[i];
    }
  }
}

void analysis::solve(workspace &work, double *x) const {
  const real one = 1.0, minus = -1.0, zero = 0.0;
  const int step = 1;
  real *const y = work.column.get(), *const part = y + n;
  for (integer k = 0; k < n; ++k)
    y[k] = x[unknown_at[k]];
  for (integer k = 0; k < supernodes; ++k) {
    const integer own = columns_of(k), height = rows_of(k), rest = height - own;
    const real *block = work.arena.get() + block_start[k];
    const integer *below = rows.data() + row_start[k] + own;
    strsv_("L", "N", "N", &own, block, &height, y + first[k], &step);
    if (rest == 0)
      continue;
    sgemv_("N", &rest, &own, &one, block + own, &height, y + first[k], &step, &zero, part, &step);
    for (integer i = 0; i < rest; ++i)
      y[below[i]] -= part[i];
  }
  for (integer k = supernodes - 1; k >= 0; --k) {
    const integer own = columns_of(k), height = rows_of(k), rest = height - own;
    const real *block = work.arena.get() + block_start[k];
    const integer *below = rows.data() + row_start[k] + own;
    if (rest > 0) {
      for (integer i = 0; i < rest; ++i)
        part[i] = y[below[i]];
      sgemv_("T", &rest, &own, &minus, block + own, &height, part, &step, &one, y + first[k], &step);
    }
    strsv_("L", "T", "N", &own, block, &height, y + first[k], &step);
  }
  for (integer k = 0; k < n; ++k)
    x[unknown_at[k]] = y[k];
}

} // namespace bayesindent
