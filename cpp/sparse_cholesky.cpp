#include "sparse_cholesky.h"

#include <suitesparse/cholmod.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <new>
#include <stdexcept>
#include <vector>

extern "C" {
void dpotrf_(const char *, const int *, double *, const int *, int *);
void dtrsm_(const char *, const char *, const char *, const char *, const int *, const int *, const double *, const double *,
            const int *, double *, const int *);
void dtrtri_(const char *, const char *, const int *, double *, const int *, int *);
void dsyrk_(const char *, const char *, const int *, const int *, const double *, const double *, const int *, const double *,
            double *, const int *);
void dgemm_(const char *, const char *, const int *, const int *, const int *, const double *, const double *, const int *,
            const double *, const int *, const double *, double *, const int *);
void openblas_set_num_threads(int) __attribute__((weak));
}

namespace {

using integer = std::int32_t;

// Columns that a front factors at a time.
constexpr integer panel_width = 48;

struct refusal {
  integer status;
};

// Owns cholmod_common and what CHOLMOD allocates while a pattern is analysed.
class analyser {
public:
  analyser() {
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_GIVEN;
    common.postorder = 1;
    // Dense BLAS wants wide supernodes: merge them as long as the explicit zeros stay a modest fraction.
    common.nrelax[0] = 12;
    common.nrelax[1] = 32;
    common.nrelax[2] = 96;
    common.zrelax[0] = 0.6;
    common.zrelax[1] = 0.1;
    common.zrelax[2] = 0.01;
  }
  ~analyser() {
    cholmod_free_factor(&factor, &common);
    cholmod_finish(&common);
  }
  analyser(const analyser &) = delete;
  analyser &operator=(const analyser &) = delete;

  void check(bool done) const {
    if (done && common.status >= CHOLMOD_OK)
      return;
    throw refusal{common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE ? sparse_cholesky_no_memory
                                                                                               : sparse_cholesky_internal};
  }

  cholmod_common common;
  cholmod_factor *factor = nullptr;
};

cholmod_sparse pattern(integer n, const integer *start, const integer *row, int stype) {
  cholmod_sparse a;
  std::memset(&a, 0, sizeof a);
  a.nrow = a.ncol = n;
  a.nzmax = start[n];
  a.p = const_cast<integer *>(start);
  a.i = const_cast<integer *>(row);
  a.stype = stype;
  a.itype = CHOLMOD_INT;
  a.xtype = CHOLMOD_PATTERN;
  a.dtype = CHOLMOD_DOUBLE;
  a.sorted = 1;
  a.packed = 1;
  return a;
}

// Nested dissection of the graph of the groups.
std::vector<integer> order_groups(integer n, const integer *start, const integer *row, const integer *group, integer groups,
                                cholmod_common &common) {
  std::vector<std::vector<integer>> below(groups);
  for (integer j = 0; j < n; ++j) {
    for (integer p = start[j]; p < start[j + 1]; ++p) {
      const integer a = std::min(group[row[p]], group[j]), b = std::max(group[row[p]], group[j]);
      if (below[a].empty() || below[a].back() != b)
        below[a].push_back(b);
    }
  }
  std::vector<integer> group_start(groups + 1, 0), group_row;
  for (integer a = 0; a < groups; ++a) {
    std::sort(below[a].begin(), below[a].end());
    below[a].erase(std::unique(below[a].begin(), below[a].end()), below[a].end());
    group_row.insert(group_row.end(), below[a].begin(), below[a].end());
    group_start[a + 1] = static_cast<integer>(group_row.size());
  }
  cholmod_sparse graph = pattern(groups, group_start.data(), group_row.data(), -1);
  std::vector<integer> order(groups);
  if (!cholmod_metis(&graph, nullptr, 0, 0, order.data(), &common))
    throw refusal{sparse_cholesky_internal};
  return order;
}

class workspace {
public:
  // The factor grows from the bottom of `arena`, one stack from its top; the other stack has its own memory.
  std::unique_ptr<double[]> arena, stack, panel, scratch;
  std::size_t scratch_size = 0;
};

class analysis {
public:
  analysis(integer n, const integer *start, const integer *row, const integer *group, integer kept);

  std::unique_ptr<workspace> acquire();
  void release(std::unique_ptr<workspace> used);
  integer factor(workspace &work, const double *values, integer *unknown) const;
  void kept_factor(const workspace &work, double *factor) const;
  void solve(workspace &work, integer count, double *x) const;

  double entries = 0.0, operations = 0.0, bytes = 0.0;

private:
  integer columns_of(integer s) const { return first[s + 1] - first[s]; }
  integer rows_of(integer s) const { return static_cast<integer>(row_start[s + 1] - row_start[s]); }
  std::size_t update_size(integer s) const {
    const std::size_t m = rows_of(s) - columns_of(s);
    return m * m;
  }
  // The update matrix of a supernode, `below` entries above the foot of its stack.
  double *update_matrix(workspace &work, integer s, std::size_t below) const {
    return parity[s] == upper ? work.arena.get() + arena_size - below - update_size(s) : work.stack.get() + below;
  }
  void add_child(const double *update, integer child, integer parent, double *into, bool columns) const;

  integer n, kept, supernodes;
  std::vector<integer> position;             // of an unknown in the elimination order
  std::vector<integer> unknown_at;           // its inverse
  std::vector<integer> first;                // first column of each supernode
  std::vector<std::size_t> row_start;      // of each supernode in `rows`
  std::vector<integer> rows;                 // rows of each supernode, its own columns first
  std::vector<std::size_t> block_start;    // of each supernode's columns in the factor
  std::vector<integer> parent;               // -1 at a root
  std::vector<integer> relative;             // place of each row of `rows` in the parent's rows
  std::vector<integer> child_start, child;   // children in elimination order
  std::vector<unsigned char> parity;       // of the depth of each supernode in the tree
  std::vector<integer> entry_start, entry; // entries of the matrix that each supernode receives
  std::vector<integer> target;             // place of each of them in the supernode's columns
  std::size_t arena_size = 0, stack_size = 0, panel_size = 0;
  int upper = 0; // parity of the stack in the arena
  std::mutex pool_lock;
  std::vector<std::unique_ptr<workspace>> pool;
};

analysis::analysis(integer n_, const integer *start, const integer *row, const integer *group, integer kept_) : n(n_), kept(kept_) {
  const integer groups = 1 + *std::max_element(group, group + n);
  analyser tool;
  std::vector<integer> given;
  {
    const std::vector<integer> order = order_groups(n, start, row, group, groups, tool.common);
    std::vector<integer> place(groups);
    for (integer k = 0; k < groups; ++k)
      place[order[k]] = k;
    std::vector<integer> count(groups + 1, 0);
    for (integer i = 0; i < n - kept; ++i)
      ++count[place[group[i]] + 1];
    for (integer k = 0; k < groups; ++k)
      count[k + 1] += count[k];
    given.resize(n);
    for (integer i = 0; i < n - kept; ++i)
      given[count[place[group[i]]]++] = i;
    for (integer i = n - kept; i < n; ++i)
      given[i] = i;
  }
  cholmod_sparse matrix = pattern(n, start, row, -1);
  tool.factor = cholmod_analyze_p(&matrix, given.data(), nullptr, 0, &tool.common);
  tool.check(tool.factor != nullptr);
  const cholmod_factor &symbolic = *tool.factor;
  if (!symbolic.is_super)
    throw refusal{sparse_cholesky_internal};

  const integer *permutation = static_cast<const integer *>(symbolic.Perm);
  const integer *super = static_cast<const integer *>(symbolic.super);
  const integer *pi = static_cast<const integer *>(symbolic.pi);
  const integer *s = static_cast<const integer *>(symbolic.s);
  supernodes = static_cast<integer>(symbolic.nsuper);
  unknown_at.assign(permutation, permutation + n);
  position.resize(n);
  for (integer k = 0; k < n; ++k)
    position[unknown_at[k]] = k;
  for (integer i = n - kept; i < n; ++i) {
    if (position[i] < n - kept)
      throw refusal{sparse_cholesky_internal};
  }
  first.assign(super, super + supernodes + 1);
  row_start.assign(pi, pi + supernodes + 1);
  rows.assign(s, s + pi[supernodes]);

  std::vector<integer> owner(n);
  block_start.resize(supernodes + 1);
  block_start[0] = 0;
  for (integer k = 0; k < supernodes; ++k) {
    std::fill(owner.begin() + first[k], owner.begin() + first[k + 1], k);
    block_start[k + 1] = block_start[k] + static_cast<std::size_t>(rows_of(k)) * columns_of(k);
    for (double m = rows_of(k); m > rows_of(k) - columns_of(k); --m) {
      entries += m;
      operations += m * m;
    }
  }

  parent.assign(supernodes, -1);
  relative.assign(rows.size(), -1);
  std::vector<integer> local(n, -1);
  child_start.assign(supernodes + 1, 0);
  for (integer k = 0; k < supernodes; ++k) {
    if (rows_of(k) > columns_of(k)) {
      parent[k] = owner[rows[row_start[k] + columns_of(k)]];
      ++child_start[parent[k] + 1];
    }
  }
  for (integer k = 0; k < supernodes; ++k)
    child_start[k + 1] += child_start[k];
  child.resize(child_start[supernodes]);
  {
    std::vector<integer> next(child_start.begin(), child_start.end() - 1);
    for (integer k = 0; k < supernodes; ++k)
      if (parent[k] >= 0)
        child[next[parent[k]]++] = k;
  }
  parity.assign(supernodes, 0);
  for (integer k = supernodes - 1; k >= 0; --k) {
    if (parent[k] >= 0)
      parity[k] = 1 - parity[parent[k]];
  }
  // Update matrices of even and odd depth go to stacks of their own, last in, first out: a parent's is written while its
  // children's are still there. One stack lives in the memory that the last columns of the factor will fill.
  std::size_t depth[2] = {0, 0}, alone[2] = {0, 0}, shared[2] = {0, 0};
  for (integer k = 0; k < supernodes; ++k) {
    for (std::size_t p = row_start[k]; p < row_start[k + 1]; ++p)
      local[rows[p]] = static_cast<integer>(p - row_start[k]);
    const std::size_t m = rows_of(k) - columns_of(k);
    depth[parity[k]] += m * m;
    for (int side = 0; side < 2; ++side) {
      alone[side] = std::max(alone[side], depth[side]);
      shared[side] = std::max(shared[side], block_start[k + 1] + depth[side]);
    }
    panel_size = std::max(panel_size, static_cast<std::size_t>(rows_of(k)) * panel_width);
    for (integer c = child_start[k]; c < child_start[k + 1]; ++c) {
      const integer d = child[c];
      for (std::size_t p = row_start[d] + columns_of(d); p < row_start[d + 1]; ++p) {
        relative[p] = local[rows[p]];
        if (relative[p] < 0)
          throw refusal{sparse_cholesky_internal};
      }
      const std::size_t m_child = rows_of(d) - columns_of(d);
      depth[parity[d]] -= m_child * m_child;
    }
    for (std::size_t p = row_start[k]; p < row_start[k + 1]; ++p)
      local[rows[p]] = -1;
  }

  upper = shared[0] + alone[1] <= shared[1] + alone[0] ? 0 : 1;
  arena_size = shared[upper];
  stack_size = alone[1 - upper];

  std::vector<integer> column_count(n + 1, 0);
  const integer entries_given = start[n];
  std::vector<integer> column_of(entries_given), row_of(entries_given);
  for (integer j = 0; j < n; ++j) {
    for (integer p = start[j]; p < start[j + 1]; ++p) {
      column_of[p] = std::min(position[j], position[row[p]]);
      row_of[p] = std::max(position[j], position[row[p]]);
      ++column_count[column_of[p] + 1];
    }
  }
  for (integer j = 0; j < n; ++j)
    column_count[j + 1] += column_count[j];
  entry.resize(entries_given);
  target.resize(entries_given);
  entry_start.resize(supernodes + 1);
  for (integer k = 0; k <= supernodes; ++k)
    entry_start[k] = column_count[first[k]];
  for (integer p = 0; p < entries_given; ++p)
    entry[column_count[column_of[p]]++] = p;
  for (integer k = 0; k < supernodes; ++k) {
    for (std::size_t p = row_start[k]; p < row_start[k + 1]; ++p)
      local[rows[p]] = static_cast<integer>(p - row_start[k]);
    for (integer e = entry_start[k]; e < entry_start[k + 1]; ++e)
      target[e] = (column_of[entry[e]] - first[k]) * rows_of(k) + local[row_of[entry[e]]];
    for (std::size_t p = row_start[k]; p < row_start[k + 1]; ++p)
      local[rows[p]] = -1;
  }
  bytes = 8.0 * static_cast<double>(arena_size + stack_size + panel_size);
  // A workspace that the machine cannot hold would be killed while it is filled, not refused when it is asked for.
  if (bytes > 0.9 * static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE)))
    throw refusal{sparse_cholesky_no_memory};
}

std::unique_ptr<workspace> analysis::acquire() {
  {
    const std::lock_guard<std::mutex> guard(pool_lock);
    if (!pool.empty()) {
      std::unique_ptr<workspace> work = std::move(pool.back());
      pool.pop_back();
      return work;
    }
  }
  auto work = std::make_unique<workspace>();
  work->arena.reset(new double[arena_size]);
  work->stack.reset(new double[stack_size]);
  work->panel.reset(new double[panel_size]);
  return work;
}

void analysis::release(std::unique_ptr<workspace> used) {
  const std::lock_guard<std::mutex> guard(pool_lock);
  pool.push_back(std::move(used));
}

// Add a child's update matrix to its parent: the part in the parent's own columns, or the part in its update matrix.
void analysis::add_child(const double *update, integer d, integer k, double *into, bool columns) const {
  const integer m = rows_of(d) - columns_of(d), own = columns_of(k), height = rows_of(k), rest = height - own;
  const integer *place = relative.data() + row_start[d] + columns_of(d);
  const integer split = static_cast<integer>(std::lower_bound(place, place + m, own) - place);
  const integer from = columns ? 0 : split, to = columns ? split : m;
  for (integer j = from; j < to; ++j) {
    const double *source = update + static_cast<std::size_t>(j) * m;
    double *column = columns ? into + static_cast<std::size_t>(place[j]) * height
                             : into + static_cast<std::size_t>(place[j] - own) * rest - own;
    integer i = j;
    while (i < m) {
      // Rows come in runs: add a run at a time.
      const integer shift = place[i] - i;
      integer end = i + 1;
      while (end < m && place[end] - end == shift)
        ++end;
      double *run = column + shift;
      for (; i < end; ++i)
        run[i] += source[i];
    }
  }
}

// Factor the `own` columns of a front of `height` rows, in place, block column by block column, so that nearly all the work
// is matrix products: also the triangular solves, by the inverse of the small diagonal block. Returns the 1-based column whose
// pivot failed, or 0.
integer factor_columns(double *block, integer height, integer own, double *panel) {
  const double one = 1.0, minus = -1.0, zero = 0.0;
  double inverse[panel_width * panel_width];
  for (integer j = 0; j < own; j += panel_width) {
    const integer width = std::min(panel_width, own - j), tall = height - j, below = tall - width;
    double *const diagonal = block + static_cast<std::size_t>(j) * height + j;
    if (j > 0)
      dgemm_("N", "T", &tall, &width, &j, &minus, block + j, &height, block + j, &height, &one, diagonal, &height);
    int info = 0;
    dpotrf_("L", &width, diagonal, &height, &info);
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
    dtrtri_("L", "N", &width, inverse, &width, &info);
    dgemm_("N", "T", &below, &width, &width, &one, panel, &below, inverse, &width, &zero, diagonal + width, &height);
  }
  return 0;
}

// Multifrontal: each supernode is a dense front to which its children add their updates. Big BLAS-3 calls throughout.
integer analysis::factor(workspace &work, const double *values, integer *unknown) const {
  const double minus = -1.0, zero = 0.0;
  std::size_t depth[2] = {0, 0};
  for (integer k = 0; k < supernodes; ++k) {
    const integer own = columns_of(k), height = rows_of(k), rest = height - own;
    const int mine = parity[k], theirs = 1 - mine;
    double *const block = work.arena.get() + block_start[k];
    std::fill(block, block + static_cast<std::size_t>(own) * height, 0.0);
    for (integer e = entry_start[k]; e < entry_start[k + 1]; ++e)
      block[target[e]] = values[entry[e]];
    std::size_t base = depth[theirs];
    for (integer c = child_start[k]; c < child_start[k + 1]; ++c)
      base -= update_size(child[c]);
    std::size_t at = base;
    for (integer c = child_start[k]; c < child_start[k + 1]; ++c) {
      add_child(update_matrix(work, child[c], at), child[c], k, block, true);
      at += update_size(child[c]);
    }
    const integer failed = factor_columns(block, height, own, work.panel.get());
    if (failed != 0) {
      *unknown = unknown_at[first[k] + failed - 1];
      return sparse_cholesky_indefinite;
    }
    if (rest > 0) {
      double *const front = update_matrix(work, k, depth[mine]);
      dsyrk_("L", "N", &rest, &own, &minus, block + own, &height, &zero, front, &rest);
      at = base;
      for (integer c = child_start[k]; c < child_start[k + 1]; ++c) {
        add_child(update_matrix(work, child[c], at), child[c], k, front, false);
        at += update_size(child[c]);
      }
      depth[mine] += update_size(k);
    }
    depth[theirs] = base;
  }
  return sparse_cholesky_ok;
}

void analysis::kept_factor(const workspace &work, double *factor) const {
  const integer offset = n - kept;
  std::fill(factor, factor + static_cast<std::size_t>(kept) * kept, 0.0);
  for (integer k = supernodes - 1; k >= 0 && first[k + 1] > offset; --k) {
    const integer height = rows_of(k);
    for (integer j = std::max(first[k], offset); j < first[k + 1]; ++j) {
      const double *column = work.arena.get() + block_start[k] + static_cast<std::size_t>(j - first[k]) * height;
      for (integer i = j - first[k]; i < height; ++i)
        factor[static_cast<std::size_t>(j - offset) * kept + rows[row_start[k] + i] - offset] = column[i];
    }
  }
}

void analysis::solve(workspace &work, integer count, double *x) const {
  const std::size_t size = static_cast<std::size_t>(n) * count;
  integer tallest = 0;
  for (integer k = 0; k < supernodes; ++k)
    tallest = std::max(tallest, rows_of(k));
  const std::size_t needed = size + static_cast<std::size_t>(tallest) * count;
  if (work.scratch_size < needed) {
    work.scratch.reset(new double[needed]);
    work.scratch_size = needed;
  }
  double *const y = work.scratch.get(), *const part = y + size;
  const double one = 1.0, minus = -1.0, zero = 0.0;
  for (integer c = 0; c < count; ++c)
    for (integer k = 0; k < n; ++k)
      y[static_cast<std::size_t>(c) * n + k] = x[static_cast<std::size_t>(c) * n + unknown_at[k]];
  for (integer k = 0; k < supernodes; ++k) {
    const integer own = columns_of(k), height = rows_of(k), rest = height - own;
    const double *block = work.arena.get() + block_start[k];
    const integer *below = rows.data() + row_start[k] + own;
    dtrsm_("L", "L", "N", "N", &own, &count, &one, block, &height, y + first[k], &n);
    if (rest == 0)
      continue;
    dgemm_("N", "N", &rest, &count, &own, &one, block + own, &height, y + first[k], &n, &zero, part, &rest);
    for (integer c = 0; c < count; ++c)
      for (integer i = 0; i < rest; ++i)
        y[static_cast<std::size_t>(c) * n + below[i]] -= part[static_cast<std::size_t>(c) * rest + i];
  }
  for (integer k = supernodes - 1; k >= 0; --k) {
    const integer own = columns_of(k), height = rows_of(k), rest = height - own;
    const double *block = work.arena.get() + block_start[k];
    const integer *below = rows.data() + row_start[k] + own;
    if (rest > 0) {
      for (integer c = 0; c < count; ++c)
        for (integer i = 0; i < rest; ++i)
          part[static_cast<std::size_t>(c) * rest + i] = y[static_cast<std::size_t>(c) * n + below[i]];
      dgemm_("T", "N", &own, &count, &rest, &minus, block + own, &height, part, &rest, &one, y + first[k], &n);
    }
    dtrsm_("L", "L", "T", "N", &own, &count, &one, block, &height, y + first[k], &n);
  }
  for (integer c = 0; c < count; ++c)
    for (integer k = 0; k < n; ++k)
      x[static_cast<std::size_t>(c) * n + unknown_at[k]] = y[static_cast<std::size_t>(c) * n + k];
}

} // namespace

extern "C" {

void *sparse_cholesky_new(integer n, const integer *column_start, const integer *row, const integer *group, integer kept, integer *status) {
  *status = sparse_cholesky_ok;
  if (n < 1 || kept < 0 || kept > n) {
    *status = sparse_cholesky_bad_input;
    return nullptr;
  }
  // Threads of BLAS under threads of ours oversubscribe the machine.
  if (openblas_set_num_threads != nullptr)
    openblas_set_num_threads(1);
  try {
    return new analysis(n, column_start, row, group, kept);
  } catch (const refusal &reason) {
    *status = reason.status;
  } catch (const std::bad_alloc &) {
    *status = sparse_cholesky_no_memory;
  }
  return nullptr;
}

void sparse_cholesky_delete(void *handle) { delete static_cast<analysis *>(handle); }

void sparse_cholesky_size(const void *handle, double *entries, double *operations, double *bytes) {
  const auto *self = static_cast<const analysis *>(handle);
  *entries = self->entries;
  *operations = self->operations;
  *bytes = self->bytes;
}

void *sparse_cholesky_acquire(void *handle) {
  try {
    return static_cast<analysis *>(handle)->acquire().release();
  } catch (const std::bad_alloc &) {
    return nullptr;
  }
}

void sparse_cholesky_release(void *handle, void *work) {
  static_cast<analysis *>(handle)->release(std::unique_ptr<workspace>(static_cast<workspace *>(work)));
}

integer sparse_cholesky_factor(const void *handle, void *work, const double *values, integer *unknown) {
  return static_cast<const analysis *>(handle)->factor(*static_cast<workspace *>(work), values, unknown);
}

void sparse_cholesky_kept_factor(const void *handle, const void *work, double *factor) {
  static_cast<const analysis *>(handle)->kept_factor(*static_cast<const workspace *>(work), factor);
}

void sparse_cholesky_solve(const void *handle, void *work, integer count, double *x) {
  static_cast<const analysis *>(handle)->solve(*static_cast<workspace *>(work), count, x);
}
}
