// The analysis of a pattern: elimination order and supernodes by METIS and CHOLMOD, the tree of the
// supernodes, the memory plan, and the places of the entries.
#include "multifrontal.h"

#include <suitesparse/cholmod.h>

#include <algorithm>
#include <csignal>
#include <numeric>

namespace bayesindent {

namespace {

// Owns cholmod_common and the memory of CHOLMOD during the analysis of a pattern.
class analyser {
public:
  analyser() {
    cholmod_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_GIVEN;
    common.postorder = 1;
    // Dense BLAS is fastest on wide supernodes. These are CHOLMOD's rules for merging them: as many
    // columns, and at most these shares of explicit zeros.
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
    if (!done || common.status < CHOLMOD_OK)
      throw common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE ? no_memory
                                                                                         : internal;
  }

  cholmod_common common;
  cholmod_factor *factor = nullptr;
};

// METIS replaces the handlers of SIGTERM and SIGABRT while it works, and restores them as handlers
// that act only once. This class restores the original ones and blocks SIGTERM in this thread
// meanwhile.
class signal_keeper {
public:
  signal_keeper() : alone(one_at_a_time) {
    sigset_t waiting;
    sigemptyset(&waiting);
    sigaddset(&waiting, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &waiting, &mask);
    sigaction(SIGTERM, nullptr, &terminate);
    sigaction(SIGABRT, nullptr, &abort);
  }
  ~signal_keeper() {
    sigaction(SIGTERM, &terminate, nullptr);
    sigaction(SIGABRT, &abort, nullptr);
    pthread_sigmask(SIG_SETMASK, &mask, nullptr);
  }

private:
  static inline std::mutex one_at_a_time;
  const std::lock_guard<std::mutex> alone;
  sigset_t mask;
  struct sigaction terminate, abort;
};

cholmod_sparse pattern(integer n, const integer *start, const integer *row) {
  cholmod_sparse lower = {};
  lower.nrow = lower.ncol = n;
  lower.nzmax = start[n];
  lower.p = const_cast<integer *>(start);
  lower.i = const_cast<integer *>(row);
  lower.stype = -1;
  lower.itype = CHOLMOD_INT;
  lower.xtype = CHOLMOD_PATTERN;
  lower.dtype = CHOLMOD_DOUBLE;
  lower.packed = 1;
  return lower;
}

// Nested dissection of the graph of the groups, in which the first unknown of each group represents
// it. Returns the place of each group in the elimination order.
std::vector<integer> places_of_groups(integer n, const integer *start, const integer *row,
                                      const integer *group, analyser &tool) {
  const integer groups = 1 + *std::max_element(group, group + n);
  std::vector<integer> first(groups, n), group_start(1, 0), group_row, order(groups), place(groups);
  for (integer i = n; i-- > 0;)
    first[group[i]] = i;
  for (integer a = 0; a < groups; ++a) {
    for (integer p = start[first[a]]; p < start[first[a] + 1]; ++p) {
      if (first[group[row[p]]] == row[p])
        group_row.push_back(group[row[p]]);
    }
    std::sort(group_row.begin() + group_start.back(), group_row.end());
    group_start.push_back(static_cast<integer>(group_row.size()));
  }
  cholmod_sparse graph = pattern(groups, group_start.data(), group_row.data());
  const signal_keeper signals;
  tool.check(cholmod_metis(&graph, nullptr, 0, 0, order.data(), &tool.common) != 0);
  for (integer k = 0; k < groups; ++k)
    place[order[k]] = k;
  return place;
}

} // namespace

analysis::analysis(integer n_, const integer *start, const integer *row, const integer *group,
                   integer retained_)
    : n(n_), retained(retained_) {
  find_supernodes(start, row, group);
  build_tree();
  plan_memory();
  map_entries(start, row);
}

void analysis::find_supernodes(const integer *start, const integer *row, const integer *group) {
  analyser tool;
  const std::vector<integer> place = places_of_groups(n, start, row, group, tool);
  std::vector<integer> given(n);
  std::iota(given.begin(), given.end(), 0);
  std::stable_sort(given.begin(), given.end() - retained,
                   [&](integer i, integer j) { return place[group[i]] < place[group[j]]; });
  cholmod_sparse matrix = pattern(n, start, row);
  tool.factor = cholmod_analyze_p(&matrix, given.data(), nullptr, 0, &tool.common);
  tool.check(tool.factor != nullptr && tool.factor->is_super != 0);
  const cholmod_factor &symbolic = *tool.factor;

  const integer *permutation = static_cast<const integer *>(symbolic.Perm);
  const integer *super = static_cast<const integer *>(symbolic.super);
  const integer *pi = static_cast<const integer *>(symbolic.pi);
  const integer *s = static_cast<const integer *>(symbolic.s);
  supernodes = static_cast<integer>(symbolic.nsuper);
  unknown_at.assign(permutation, permutation + n);
  tool.check(std::all_of(unknown_at.end() - retained, unknown_at.end(),
                         [this](integer i) { return i >= n - retained; }));
  position.resize(n);
  for (integer k = 0; k < n; ++k)
    position[unknown_at[k]] = k;
  first.assign(super, super + supernodes + 1);
  row_start.assign(pi, pi + supernodes + 1);
  rows.assign(s, s + pi[supernodes]);
}

void analysis::build_tree() {
  std::vector<integer> owner(n), parent(supernodes, -1);
  block_start.resize(supernodes + 1);
  block_start[0] = 0;
  for (integer k = 0; k < supernodes; ++k) {
    std::fill(owner.begin() + first[k], owner.begin() + first[k + 1], k);
    block_start[k + 1] = block_start[k] + static_cast<std::size_t>(rows_of(k)) * columns_of(k);
    for (double m = rows_of(k); m > rows_of(k) - columns_of(k); --m) {
      sizes[0] += m;
      sizes[1] += m * m;
    }
  }
  children.resize(supernodes);
  parity.assign(supernodes, 0);
  for (integer k = 0; k < supernodes; ++k) {
    if (rows_of(k) > columns_of(k)) {
      parent[k] = owner[rows[row_start[k] + columns_of(k)]];
      children[parent[k]].push_back(k);
    }
  }
  for (integer k = supernodes - 1; k >= 0; --k) {
    if (parent[k] >= 0)
      parity[k] = 1 - parity[parent[k]];
  }
}

// Update matrices of even and odd depth in the tree are on separate stacks, because a parent's
// matrix is written while its children's are read. One of the stacks uses the memory that the last
// columns of the factor will fill.
void analysis::plan_memory() {
  relative.resize(rows.size());
  run_end.resize(rows.size());
  std::vector<integer> local(n);
  integer tallest = 0;
  std::size_t depth[2] = {0, 0}, alone[2] = {0, 0}, shared[2] = {0, 0};
  for (integer k = 0; k < supernodes; ++k) {
    for (integer i = 0; i < rows_of(k); ++i)
      local[rows[row_start[k] + i]] = i;
    depth[parity[k]] += update_size(k);
    for (int side = 0; side < 2; ++side) {
      alone[side] = std::max(alone[side], depth[side]);
      shared[side] = std::max(shared[side], block_start[k + 1] + depth[side]);
    }
    tallest = std::max(tallest, rows_of(k));
    for (const integer d : children[k]) {
      for (integer m = rows_of(d) - columns_of(d), i = m; i-- > 0;) {
        const std::size_t p = row_start[d + 1] - m + i;
        relative[p] = local[rows[p]];
        run_end[p] = i + 1 < m && relative[p + 1] == relative[p] + 1 ? run_end[p + 1] : i + 1;
      }
      depth[parity[d]] -= update_size(d);
    }
  }
  upper = shared[0] + alone[1] <= shared[1] + alone[0] ? 0 : 1;
  arena_size = shared[upper];
  stack_size = alone[1 - upper];
  column_size = (static_cast<std::size_t>(n) + tallest) * solved_together;
  sizes[2] = static_cast<double>(sizeof(real)) *
             static_cast<double>(arena_size + stack_size + column_size);
}

void analysis::map_entries(const integer *start, const integer *row) {
  entries_of.resize(supernodes);
  for (integer j = 0; j < n; ++j) {
    for (integer p = start[j]; p < start[j + 1]; ++p) {
      const auto [column, below] = std::minmax(position[j], position[row[p]]);
      const integer k = static_cast<integer>(std::upper_bound(first.begin(), first.end(), column) -
                                             first.begin()) -
                        1;
      const auto own = rows.begin() + static_cast<std::ptrdiff_t>(row_start[k]);
      const auto place = std::lower_bound(own, own + rows_of(k), below) - own;
      entries_of[k].emplace_back(p, (column - first[k]) * rows_of(k) + static_cast<integer>(place));
    }
  }
}

} // namespace bayesindent
