// The analysis of a pattern: tree of supernodes, memory plan, places of the entries; and the pool of workspaces.
#include "multifrontal.h"

#include <algorithm>

namespace bayesindent {

analysis::analysis(integer n_, const integer *start, const integer *row, const integer *group, integer kept_) : n(n_), kept(kept_) {
  find_supernodes(start, row, group);
  build_tree();
  plan_memory();
  map_entries(start, row);
}

void analysis::build_tree() {
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
  children.resize(supernodes);
  for (integer k = 0; k < supernodes; ++k) {
    if (rows_of(k) > columns_of(k)) {
      parent[k] = owner[rows[row_start[k] + columns_of(k)]];
      children[parent[k]].push_back(k);
    }
  }
  parity.assign(supernodes, 0);
  for (integer k = supernodes - 1; k >= 0; --k) {
    if (parent[k] >= 0)
      parity[k] = 1 - parity[parent[k]];
  }
}

// Update matrices of even and odd depth go to stacks of their own, last in, first out: a parent's is written while its
// children's are still there. One stack lives in the memory that the last columns of the factor will fill.
void analysis::plan_memory() {
  relative.assign(rows.size(), -1);
  std::vector<integer> local(n, -1);
  integer tallest = 0;
  std::size_t depth[2] = {0, 0}, alone[2] = {0, 0}, shared[2] = {0, 0};
  for (integer k = 0; k < supernodes; ++k) {
    for (std::size_t p = row_start[k]; p < row_start[k + 1]; ++p)
      local[rows[p]] = static_cast<integer>(p - row_start[k]);
    depth[parity[k]] += update_size(k);
    for (int side = 0; side < 2; ++side) {
      alone[side] = std::max(alone[side], depth[side]);
      shared[side] = std::max(shared[side], block_start[k + 1] + depth[side]);
    }
    tallest = std::max(tallest, rows_of(k));
    for (const integer d : children[k]) {
      for (std::size_t p = row_start[d] + columns_of(d); p < row_start[d + 1]; ++p) {
        relative[p] = local[rows[p]];
        if (relative[p] < 0)
          throw refusal{bayesindent_cholesky_internal};
      }
      depth[parity[d]] -= update_size(d);
    }
    for (std::size_t p = row_start[k]; p < row_start[k + 1]; ++p)
      local[rows[p]] = -1;
  }
  upper = shared[0] + alone[1] <= shared[1] + alone[0] ? 0 : 1;
  arena_size = shared[upper];
  stack_size = alone[1 - upper];
  panel_size = static_cast<std::size_t>(tallest) * panel_width;
  column_size = static_cast<std::size_t>(n) + tallest;
  bytes = static_cast<double>(sizeof(real)) * static_cast<double>(arena_size + stack_size + panel_size + column_size);
}

void analysis::map_entries(const integer *start, const integer *row) {
  entries_of.resize(supernodes);
  for (integer j = 0; j < n; ++j) {
    for (integer p = start[j]; p < start[j + 1]; ++p) {
      const auto [column, below] = std::minmax(position[j], position[row[p]]);
      const integer k = static_cast<integer>(std::upper_bound(first.begin(), first.end(), column) - first.begin()) - 1;
      const auto own = rows.begin() + static_cast<std::ptrdiff_t>(row_start[k]);
      const auto place = std::lower_bound(own, own + rows_of(k), below) - own;
      entries_of[k].emplace_back(p, (column - first[k]) * rows_of(k) + static_cast<integer>(place));
    }
  }
}

// Memory is written as it is allocated: what is free then counts all that other threads were given.
std::unique_ptr<workspace> analysis::acquire(double free_bytes) {
  const std::lock_guard<std::mutex> guard(pool_lock);
  if (!pool.empty()) {
    std::unique_ptr<workspace> work = std::move(pool.back());
    pool.pop_back();
    return work;
  }
  if (bytes > free_bytes)
    throw refusal{bayesindent_cholesky_no_memory};
  auto work = std::make_unique<workspace>();
  work->arena = std::make_unique<real[]>(arena_size);
  work->stack = std::make_unique<real[]>(stack_size);
  work->panel = std::make_unique<real[]>(panel_size);
  work->column = std::make_unique<real[]>(column_size);
  return work;
}

void analysis::release(std::unique_ptr<workspace> used) {
  const std::lock_guard<std::mutex> guard(pool_lock);
  pool.push_back(std::move(used));
}

} // namespace bayesindent
