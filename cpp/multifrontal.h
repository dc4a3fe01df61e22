// Multifrontal Cholesky factorisation over CHOLMOD's symbolic analysis: the analysis of a pattern,
// and workspaces for the numbers.
#ifndef BAYESINDENT_MULTIFRONTAL_H
#define BAYESINDENT_MULTIFRONTAL_H

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace bayesindent {

using integer = std::int32_t;
// Precision of the factor. A modulus needs four digits, and single precision gives more
// (docs/simulation.md); solutions are refined.
using real = float;

// The values are those of the Fortran module `sparse_cholesky`.
enum status : integer { ok, indefinite, no_memory, internal };

// Fronts of at most this many columns are factored without recursion.
constexpr integer panel_width = 48;
// Right-hand sides that are solved together.
constexpr integer solved_together = 10;

// The numbers of one matrix, used by one thread at a time.
struct workspace {
  // The factor grows from the bottom of `arena`, one stack of update matrices from its top; the
  // other stack has memory of its own.
  std::unique_ptr<real[]> arena, stack;
  // Permuted right-hand sides and their rows of one front.
  std::unique_ptr<real[]> column;
};

// A pattern with its elimination order, supernodes and memory plan. Only the pool of workspaces
// changes after construction.
struct analysis {
  // Arguments: the lower triangle in compressed columns, the group of each unknown, and the number
  // of retained unknowns, which are eliminated last. Throws a `status`.
  analysis(integer n, const integer *start, const integer *row, const integer *group,
           integer retained);

  integer columns_of(integer s) const { return first[s + 1] - first[s]; }
  integer rows_of(integer s) const { return static_cast<integer>(row_start[s + 1] - row_start[s]); }
  std::size_t update_size(integer s) const {
    const std::size_t m = rows_of(s) - columns_of(s);
    return m * m;
  }

  // Steps of the constructor.
  void find_supernodes(const integer *start, const integer *row, const integer *group);
  void build_tree();
  void plan_memory();
  void map_entries(const integer *start, const integer *row);

  integer n, retained, supernodes = 0;
  std::vector<integer> position;        // of an unknown in the elimination order
  std::vector<integer> unknown_at;      // its inverse
  std::vector<integer> first;           // first column of each supernode
  std::vector<std::size_t> row_start;   // of each supernode in `rows`
  std::vector<integer> rows;            // rows of each supernode, its own columns first
  std::vector<std::size_t> block_start; // of each supernode's columns in the factor
  std::vector<integer> relative;        // place of each row of `rows` in the parent's rows
  std::vector<integer>
      run_end; // of the run of adjacent places that each row of an update matrix is in
  std::vector<std::vector<integer>> children; // of each supernode, in elimination order
  std::vector<unsigned char> parity;          // of the depth of each supernode in the tree
  // Entries of the matrix that belong to each supernode, and their places in its columns.
  std::vector<std::vector<std::pair<integer, integer>>> entries_of;
  std::size_t arena_size = 0, stack_size = 0, column_size = 0;
  // Entries of the factor, floating-point operations of one factorisation, and bytes of one
  // workspace.
  double sizes[3] = {0.0, 0.0, 0.0};
  int upper = 0; // parity of the stack in the arena
  std::mutex pool_lock;
  std::vector<std::unique_ptr<workspace>> pool;
};

} // namespace bayesindent

#endif
