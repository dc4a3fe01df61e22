// Numeric factorisation of one matrix.
#include "multifrontal.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace bayesindent {

namespace {

// Factor the `own` columns of a front of `height` rows, in place, block column by block column, so that nearly all the work
// is matrix products: also the triangular solves, by the inverse of the small diagonal block. Returns the 1-based column whose
// pivot failed, or 0.
integer factor_columns(real *block, integer height, integer own, real *panel) {
  const real one = 1.0, minus = -1.0, zero = 0.0;
  real inverse[panel_width * panel_width];
  for (integer j = 0; j < own; j += panel_width) {
    const integer width = std::min(panel_width, own - j), tall = height - j, below = tall - width;
    real *const diagonal = block + static_cast<std::size_t>(j) * height + j;
    if (j > 0)
      sgemm_("N", "T", &tall, &width, &j, &minus, block + j, &height, block + j, &height, &one, diagonal, &height);
    int info = 0;
    spotrf_("L", &width, diagonal, &height, &info);
    for (integer i = 0; info == 0 && i < width; ++i) {
      if (!std::isfinite(diagonal[static_cast<std::size_t>(i) * height + i]))
        info = i + 1;
    }
    if (info != 0)
      return j + std::abs(info);
    if (below == 0)
      continue;
    for (integer c = 0; c < width; ++c) {
      std::fill(inverse + c * width, inverse + c * width + c, 0.0);
      std::copy(diagonal + static_cast<std::size_t>(c) * height + c, diagonal + static_cast<std::size_t>(c) * height + width,
                inverse + c * width + c);
      std::copy(diagonal + static_cast<std::size_t>(c) * height + width, diagonal + static_cast<std::size_t>(c) * height + tall,
                panel + static_cast<std::size_t>(c) * below);
    }
    strtri_("L", "N", &width, inverse, &width, &info);
    sgemm_("N", "T", &below, &width, &width, &one, panel, &below, inverse, &width, &zero, diagonal + width, &height);
  }
  return 0;
}

} // namespace

// Add a child's update matrix to its parent: the part in the parent's own columns, or the part in its update matrix.
void analysis::add_child(const real *update, integer d, integer k, real *into, bool columns) const {
  const integer m = rows_of(d) - columns_of(d), own = columns_of(k), height = rows_of(k), rest = height - own;
  const integer *place = relative.data() + row_start[d] + columns_of(d);
  const integer split = static_cast<integer>(std::lower_bound(place, place + m, own) - place);
  const integer from = columns ? 0 : split, to = columns ? split : m;
  for (integer j = from; j < to; ++j) {
    const real *source = update + static_cast<std::size_t>(j) * m;
    real *column =
        columns ? into + static_cast<std::size_t>(place[j]) * height : into + static_cast<std::size_t>(place[j] - own) * rest - own;
    integer i = j;
    while (i < m) {
      // Rows come in runs: add a run at a time.
      const integer shift = place[i] - i;
      integer end = i + 1;
      while (end < m && place[end] - end == shift)
        ++end;
      real *run = column + shift;
      for (; i < end; ++i)
        run[i] += source[i];
    }
  }
}

// Multifrontal: each supernode is a dense front to which its children add their updates. Big BLAS-3 calls throughout.
bayesindent_cholesky_status analysis::factor(workspace &work, const double *values, integer *unknown) const {
  const real minus = -1.0, zero = 0.0;
  std::size_t depth[2] = {0, 0};
  for (integer k = 0; k < supernodes; ++k) {
    const integer own = columns_of(k), height = rows_of(k), rest = height - own;
    const int mine = parity[k], theirs = 1 - mine;
    real *const block = work.arena.get() + block_start[k];
    std::fill(block, block + static_cast<std::size_t>(own) * height, 0.0);
    for (const auto &[entry, target] : entries_of[k])
      block[target] = static_cast<real>(values[entry]);
    std::size_t base = depth[theirs];
    for (const integer d : children[k])
      base -= update_size(d);
    std::size_t at = base;
    for (const integer d : children[k]) {
      add_child(update_matrix(work, d, at), d, k, block, true);
      at += update_size(d);
    }
    const integer failed = factor_columns(block, height, own, work.panel.get());
    if (failed != 0) {
      *unknown = unknown_at[first[k] + failed - 1];
      return bayesindent_cholesky_indefinite;
    }
    if (rest > 0) {
      real *const front = update_matrix(work, k, depth[mine]);
      ssyrk_("L", "N", &rest, &own, &minus, block + own, &height, &zero, front, &rest);
      at = base;
      for (const integer d : children[k]) {
        add_child(update_matrix(work, d, at), d, k, front, false);
        at += update_size(d);
      }
      depth[mine] += update_size(k);
    }
    depth[theirs] = base;
  }
  return bayesindent_cholesky_ok;
}

} // namespace bayesindent
