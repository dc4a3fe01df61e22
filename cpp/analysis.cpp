// The analysis of a pattern: tree of supernodes, memory plan, places of the entries; and the pool of workspaces.
#include "multifrontal.h"

#include <algorithm>
#include <numeric>

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
  child_start.assign(supernodes + 1, 0);
  for (integer k = 0; k < supernodes; ++k) {
    if (rows_of(k) > columns_of(k)) {
      parent[k] = owner[rows[row_start[k] + columns_of(k)]];
      ++child_start[parent[k] + 1];
    }
  }
  std::partial_sum(child_start.begin(), child_start.end(), child_start.begin());
  child.resize(child_start[supernodes]);
  std::vector<integer> next(child_start.begin(), child_start.end() - 1);
  for (integer k = 0; k < supernodes; ++k)
    if (parent[k] >= 0)
      child[next[parent[k]]++] = k;
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
    for (integer c = child_start[k]; c < child_start[k + 1]; ++c) {
      const integer d = child[c];
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
  const integer given = start[n];
  std::vector<integer> column_count(n + 1, 0), column_of(given), row_of(given), local(n, -1);
  for (integer j = 0; j < n; ++j) {
    for (integer p = start[j]; p < start[j + 1]; ++p) {
      column_of[p] = std::min(position[j], position[row[p]]);
      row_of[p] = std::max(position[j], position[row[p]]);
      ++column_count[column_of[p] + 1];
    }
  }
  std::partial_sum(column_count.begin(), column_count.end(), column_count.begin());
  entry.resize(given);
  target.resize(given);
  entry_start.resize(supernodes + 1);
  for (integer k = 0; k <= supernodes; ++k)
    entry_start[k] = column_count[first[k]];
  for (integer p = 0; p < given; ++p)
    entry[column_count[column_of[p]]++] = p;
  for (integer k = 0; k < supernodes; ++k) {
    for (std::size_t p = row_start[k]; p < row_start[k + 1]; ++p)
      local[rows[p]] = static_cast<integer>(p - row_start[k]);
    for (integer e = entry_start[k]; e < entry_start[k + 1]; ++e)
      target[e] = (column_of[entry[e]] - first[k]) * rows_of(k) + local[row_of[entry[e]]];
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
