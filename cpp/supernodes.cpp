// Elimination order and supernodes of a pattern, by METIS and CHOLMOD.
#include "multifrontal.h"

#include <suitesparse/cholmod.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <numeric>

namespace bayesindent {

namespace {

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
    const bool memory = common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE;
    throw refusal{memory ? bayesindent_cholesky_no_memory : bayesindent_cholesky_internal};
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

// METIS takes SIGTERM and SIGABRT for itself while it works, and gives them back to handlers that act only once. Here they stay
// what they were, and a SIGTERM to this thread waits.
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

// Nested dissection of the graph of the groups.
std::vector<integer> order_groups(integer n, const integer *start, const integer *row, const integer *group, analyser &tool) {
  const integer groups = 1 + *std::max_element(group, group + n);
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
  const signal_keeper kept;
  tool.check(cholmod_metis(&graph, nullptr, 0, 0, order.data(), &tool.common) != 0);
  return order;
}

// Unknowns in the order of their groups; the last `kept` stay last.
std::vector<integer> order_unknowns(integer n, const integer *start, const integer *row, const integer *group, integer kept,
                                    analyser &tool) {
  const std::vector<integer> order = order_groups(n, start, row, group, tool);
  const integer groups = static_cast<integer>(order.size());
  std::vector<integer> place(groups), count(groups + 1, 0), given(n);
  for (integer k = 0; k < groups; ++k)
    place[order[k]] = k;
  for (integer i = 0; i < n - kept; ++i)
    ++count[place[group[i]] + 1];
  std::partial_sum(count.begin(), count.end(), count.begin());
  for (integer i = 0; i < n - kept; ++i)
    given[count[place[group[i]]]++] = i;
  for (integer i = n - kept; i < n; ++i)
    given[i] = i;
  return given;
}

} // namespace

void analysis::find_supernodes(const integer *start, const integer *row, const integer *group) {
  analyser tool;
  std::vector<integer> given = order_unknowns(n, start, row, group, kept, tool);
  cholmod_sparse matrix = pattern(n, start, row, -1);
  tool.factor = cholmod_analyze_p(&matrix, given.data(), nullptr, 0, &tool.common);
  tool.check(tool.factor != nullptr);
  const cholmod_factor &symbolic = *tool.factor;
  if (!symbolic.is_super)
    throw refusal{bayesindent_cholesky_internal};

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
      throw refusal{bayesindent_cholesky_internal};
  }
  first.assign(super, super + supernodes + 1);
  row_start.assign(pi, pi + supernodes + 1);
  rows.assign(s, s + pi[supernodes]);
}

} // namespace bayesindent
