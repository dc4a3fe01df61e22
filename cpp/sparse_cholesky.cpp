// Sparse Cholesky factorisation of many matrices with the same pattern. A C interface for Fortran.
//
// The lower triangle of a symmetric matrix is given in compressed columns, 0-based, diagonal
// included. The last `retained` unknowns are eliminated last, so that the trailing block of the
// factor is the factor of their Schur complement. An analysis does not change once made and may be
// shared by threads; each thread acquires a workspace of its own.
#include "multifrontal.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>

// Procedures of BLAS and LAPACK for the factorisation.
extern "C" {
void spotrf_(const char *, const int *, float *, const int *, int *);
void strsm_(const char *, const char *, const char *, const char *, const int *, const int *,
            const float *, const float *, const int *, float *, const int *);
void strtri_(const char *, const char *, const int *, float *, const int *, int *);
void ssyrk_(const char *, const char *, const int *, const int *, const float *, const float *,
            const int *, const float *, float *, const int *);
void sgemm_(const char *, const char *, const int *, const int *, const int *, const float *,
            const float *, const int *, const float *, const int *, const float *, float *,
            const int *);
void openblas_set_num_threads(int) __attribute__((weak));
std::int32_t bayesindent_reserve_blas(std::int32_t callers);
void bayesindent_return_memory();
}

using namespace bayesindent;

namespace {

// Number of workspaces in use; each calls BLAS.
std::atomic<integer> in_use{0};

// Factors the first `own` columns of a front of `tall` rows in place, recursively: one half, its
// products for the other half, and the other half. Nearly all the work is then products of large
// matrices. Triangular solves are products, too, with the inverse of the small diagonal block.
// Returns the 1-based column whose pivot failed, or 0.
integer factor_columns(real *block, integer height, integer tall, integer own) {
  const real one = 1.0, minus = -1.0, zero = 0.0;
  const std::ptrdiff_t step = height;
  if (own > panel_width) {
    const integer left = (own / panel_width + 1) / 2 * panel_width, right = own - left,
                  below = tall - own;
    real *const diagonal = block + left * step + left;
    integer failed = factor_columns(block, height, tall, left);
    if (failed != 0)
      return failed;
    ssyrk_("L", "N", &right, &left, &minus, block + left, &height, &one, diagonal, &height);
    if (below > 0)
      sgemm_("N", "T", &below, &right, &left, &minus, block + own, &height, block + left, &height,
             &one, diagonal + right, &height);
    failed = factor_columns(diagonal, height, tall - left, right);
    return failed == 0 ? 0 : left + failed;
  }
  // Rows that fit into a cache.
  constexpr integer piece_rows = 192;
  real inverse[panel_width * panel_width], piece[panel_width * piece_rows];
  int info = 0;
  spotrf_("L", &own, block, &height, &info);
  for (integer i = 0; info == 0 && i < own; ++i) {
    if (!std::isfinite(block[i * step + i]))
      info = i + 1;
  }
  if (info != 0)
    return std::abs(info);
  for (integer c = 0; c < own; ++c) {
    std::fill(inverse + c * own, inverse + c * own + c, 0.0);
    std::copy_n(block + c * step + c, own - c, inverse + c * own + c);
  }
  strtri_("L", "N", &own, inverse, &own, &info);
  for (integer done = own; done < tall; done += piece_rows) {
    const integer rows = std::min(piece_rows, tall - done);
    for (integer c = 0; c < own; ++c)
      std::copy_n(block + c * step + done, rows, piece + c * rows);
    sgemm_("N", "T", &rows, &own, &own, &one, piece, &rows, inverse, &own, &zero, block + done,
           &height);
  }
  return 0;
}

// Adds the columns `from` to `to` of a child's update matrix, numbered as in the parent. `into` is
// the first of them, with `stride` between the columns.
void add_child(const analysis &self, const real *update, integer d, integer from, integer to,
               real *into, std::ptrdiff_t stride) {
  const std::ptrdiff_t m = self.rows_of(d) - self.columns_of(d);
  const std::size_t start = self.row_start[d] + self.columns_of(d);
  const integer *const place = self.relative.data() + start, *const run_end =
                                                                 self.run_end.data() + start;
  const integer *const last = std::lower_bound(place, place + m, to);
  for (const integer *at = std::lower_bound(place, last, from); at < last; ++at) {
    std::ptrdiff_t i = at - place;
    const real *const source = update + i * m;
    real *const column = into + (*at - from) * stride - from;
    while (i < m) {
      // Adjacent rows are added in runs.
      const integer end = run_end[i];
      real *const run = column + place[i] - i;
      for (; i < end; ++i)
        run[i] += source[i];
    }
  }
}

// The update matrix of a supernode, `below` entries above the beginning of its stack.
real *update_matrix(const analysis &self, workspace &work, integer s, std::size_t below) {
  return self.parity[s] == self.upper
             ? work.arena.get() + self.arena_size - below - self.update_size(s)
             : work.stack.get() + below;
}

} // namespace

extern "C" {

// Orders and analyses a pattern. `group[i]` numbers (from 0) the mesh node of unknown i: unknowns
// of a node share their neighbours, and the ordering works on nodes. The sizes are the entries of
// the factor, the floating-point operations of one factorisation, and the bytes of one workspace.
// Returns null on failure, with the reason in `outcome`.
void *bayesindent_cholesky_new(integer n, const integer *column_start, const integer *row,
                               const integer *group, integer retained, double *sizes,
                               integer *outcome) {
  // Threads of BLAS within threads of this program oversubscribe the machine.
  if (openblas_set_num_threads != nullptr)
    openblas_set_num_threads(1);
  analysis *made = nullptr;
  *outcome = ok;
  try {
    made = new analysis(n, column_start, row, group, retained);
    std::copy_n(made->sizes, 3, sizes);
  } catch (const status &reason) {
    *outcome = reason;
  } catch (const std::bad_alloc &) {
    *outcome = no_memory;
  } catch (...) {
    *outcome = internal;
  }
  // An analysis needs much memory for a short time.
  bayesindent_return_memory();
  return made;
}

void bayesindent_cholesky_delete(analysis *self) { delete self; }

// Acquires a workspace: a released one, or a new one if it needs at most `free_bytes`. Returns null
// if memory does not suffice. Allocation writes to the memory, so the free memory that is measured
// later excludes the workspaces of other threads.
workspace *bayesindent_cholesky_acquire(analysis *self, double free_bytes) {
  const std::lock_guard<std::mutex> guard(self->pool_lock);
  if (const integer users = in_use + 1; bayesindent_reserve_blas(users) < users)
    return nullptr;
  if (self->pool.empty()) {
    if (self->sizes[2] > free_bytes)
      return nullptr;
    try {
      auto work = std::make_unique<workspace>();
      work->arena = std::make_unique<real[]>(self->arena_size);
      work->stack = std::make_unique<real[]>(self->stack_size);
      work->column = std::make_unique<real[]>(self->column_size);
      self->pool.push_back(std::move(work));
    } catch (const std::bad_alloc &) {
      return nullptr;
    }
  }
  workspace *const work = self->pool.back().release();
  self->pool.pop_back();
  ++in_use;
  return work;
}

void bayesindent_cholesky_release(analysis *self, workspace *work) {
  const std::lock_guard<std::mutex> guard(self->pool_lock);
  self->pool.emplace_back(work);
  --in_use;
}

// Factors the matrix with these values (order of `row`). If it is indefinite, `unknown` is the
// 0-based unknown whose pivot failed. The method is multifrontal: each supernode is a dense front
// to which its children add their updates by large products of matrices.
integer bayesindent_cholesky_factor(const analysis *handle, workspace *work, const double *values,
                                    integer *unknown) {
  const analysis &self = *handle;
  const real minus = -1.0, one = 1.0;
  std::size_t depth[2] = {0, 0};
  for (integer k = 0; k < self.supernodes; ++k) {
    const integer own = self.columns_of(k), height = self.rows_of(k), rest = height - own;
    const int mine = self.parity[k], theirs = 1 - mine;
    real *const block = work->arena.get() + self.block_start[k];
    std::size_t base = depth[theirs];
    for (const integer d : self.children[k])
      base -= self.update_size(d);
    // The sum of the children's update matrices below the diagonal, some columns at a time.
    const auto add_children = [&](integer from, integer to, real *into, std::ptrdiff_t stride) {
      constexpr integer some = 16;
      for (; from < to; from += some, into += some * stride + some) {
        const integer end = std::min(to, from + some);
        for (integer j = 0; j < end - from; ++j)
          std::fill_n(into + j * stride + j, height - from - j, 0.0);
        std::size_t at = base;
        for (const integer d : self.children[k]) {
          add_child(self, update_matrix(self, *work, d, at), d, from, end, into, stride);
          at += self.update_size(d);
        }
      }
    };
    add_children(0, own, block, height);
    for (const auto &[entry, target] : self.entries_of[k])
      block[target] += static_cast<real>(values[entry]);
    const integer failed = factor_columns(block, height, height, own);
    if (failed != 0) {
      *unknown = self.unknown_at[self.first[k] + failed - 1];
      return indefinite;
    }
    if (rest > 0) {
      real *const front = update_matrix(self, *work, k, depth[mine]);
      add_children(own, height, front, rest);
      ssyrk_("L", "N", &rest, &own, &minus, block + own, &height, &one, front, &rest);
      depth[mine] += self.update_size(k);
    }
    depth[theirs] = base;
  }
  return ok;
}

// The lower Cholesky factor (retained x retained, column-major, zeros above) of the Schur
// complement of the retained unknowns.
void bayesindent_cholesky_retained_factor(const analysis *handle, const workspace *work,
                                          double *factor) {
  const analysis &self = *handle;
  const std::ptrdiff_t retained = self.retained;
  const integer offset = self.n - self.retained;
  std::fill(factor, factor + retained * retained, 0.0);
  for (integer k = self.supernodes - 1; k >= 0 && self.first[k + 1] > offset; --k) {
    const std::ptrdiff_t height = self.rows_of(k);
    for (integer j = std::max(self.first[k], offset); j < self.first[k + 1]; ++j) {
      const real *column = work->arena.get() + self.block_start[k] + (j - self.first[k]) * height;
      for (integer i = j - self.first[k]; i < height; ++i)
        factor[(j - offset) * retained + self.rows[self.row_start[k] + i] - offset] = column[i];
    }
  }
}

// Overwrites `count` right-hand sides `x`, one after another, with the solutions.
void bayesindent_cholesky_solve(const analysis *handle, workspace *work, integer count, double *x) {
  const analysis &self = *handle;
  const real one = 1.0, minus = -1.0, zero = 0.0;
  const integer n = self.n;
  const std::ptrdiff_t step = n;
  for (; count > 0; count -= solved_together, x += solved_together * step) {
    const integer some = std::min(count, solved_together);
    real *const y = work->column.get(), *const part = y + some * step;
    // Entries before the first non-zero load stay zero.
    integer loaded = n;
    for (integer k = n; k-- > 0;) {
      for (integer j = 0; j < some; ++j) {
        y[j * step + k] = x[j * step + self.unknown_at[k]];
        if (y[j * step + k] != 0.0)
          loaded = k;
      }
    }
    for (integer k = 0; k < self.supernodes; ++k) {
      if (self.first[k + 1] <= loaded)
        continue;
      const integer own = self.columns_of(k), height = self.rows_of(k), rest = height - own;
      const real *block = work->arena.get() + self.block_start[k];
      const integer *below = self.rows.data() + self.row_start[k] + own;
      real *const mine = y + self.first[k];
      strsm_("L", "L", "N", "N", &own, &some, &one, block, &height, mine, &n);
      if (rest == 0)
        continue;
      sgemm_("N", "N", &rest, &some, &own, &one, block + own, &height, mine, &n, &zero, part,
             &rest);
      for (integer j = 0; j < some; ++j) {
        for (integer i = 0; i < rest; ++i)
          y[j * step + below[i]] -= part[j * rest + i];
      }
    }
    for (integer k = self.supernodes - 1; k >= 0; --k) {
      const integer own = self.columns_of(k), height = self.rows_of(k), rest = height - own;
      const real *block = work->arena.get() + self.block_start[k];
      const integer *below = self.rows.data() + self.row_start[k] + own;
      real *const mine = y + self.first[k];
      if (rest > 0) {
        for (integer j = 0; j < some; ++j) {
          for (integer i = 0; i < rest; ++i)
            part[j * rest + i] = y[j * step + below[i]];
        }
        sgemm_("T", "N", &own, &some, &rest, &minus, block + own, &height, part, &rest, &one, mine,
               &n);
      }
      strsm_("L", "L", "T", "N", &own, &some, &one, block, &height, mine, &n);
    }
    for (integer j = 0; j < some; ++j) {
      for (integer k = 0; k < n; ++k)
        x[j * step + self.unknown_at[k]] = y[j * step + k];
    }
  }
}
}
