// Sparse Cholesky factorisation of many matrices with one pattern: a C interface, for Fortran, with handles and statuses for the
// classes behind.
//
// The lower triangle of a symmetric matrix is given in compressed columns, 0-based, diagonal included. The last `kept`
// unknowns are eliminated last, so that the trailing block of the factor is that of their Schur complement.
// An analysis is read-only once made and may be shared by threads; each thread acquires a workspace of its own.
#include "multifrontal.h"

#include <new>
#ifdef __GLIBC__
#include <malloc.h>
#endif

extern "C" void openblas_set_num_threads(int) __attribute__((weak));

using bayesindent::analysis;
using bayesindent::workspace;

extern "C" {

// `group[i]` numbers (from 0) the mesh node of unknown i: unknowns of a node share their neighbours, and the ordering
// works on nodes. Returns null on failure, with the reason in `status`.
void *bayesindent_cholesky_new(std::int32_t n, const std::int32_t *column_start, const std::int32_t *row, const std::int32_t *group,
                               std::int32_t kept, std::int32_t *status) {
  *status = bayesindent_cholesky_ok;
  if (n < 1 || kept < 0 || kept > n) {
    *status = bayesindent_cholesky_bad_input;
    return nullptr;
  }
  // Threads of BLAS under threads of ours oversubscribe the machine.
  if (openblas_set_num_threads != nullptr)
    openblas_set_num_threads(1);
  try {
    return new analysis(n, column_start, row, group, kept);
  } catch (const bayesindent::refusal &reason) {
    *status = reason.status;
  } catch (const std::bad_alloc &) {
    *status = bayesindent_cholesky_no_memory;
  } catch (...) {
    *status = bayesindent_cholesky_internal;
  }
  return nullptr;
}

// What is free goes back to the system, where the C library can: an analysis needs much for a short time.
void bayesindent_return_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

void bayesindent_cholesky_delete(void *handle) { delete static_cast<analysis *>(handle); }

// Entries of the factor, floating point operations of one factorisation, and bytes of one workspace.
void bayesindent_cholesky_size(const void *handle, double *entries, double *operations, double *bytes) {
  const auto *self = static_cast<const analysis *>(handle);
  *entries = self->entries;
  *operations = self->operations;
  *bytes = self->bytes;
}

// A workspace: a released one, else a new one if less than `free_bytes` suffice. Returns null where memory does not suffice.
void *bayesindent_cholesky_acquire(void *handle, double free_bytes) {
  try {
    return static_cast<analysis *>(handle)->acquire(free_bytes).release();
  } catch (...) {
    return nullptr;
  }
}

void bayesindent_cholesky_release(void *handle, void *work) {
  static_cast<analysis *>(handle)->release(std::unique_ptr<workspace>(static_cast<workspace *>(work)));
}

// Factor the matrix with these values (order of `row`). On `indefinite`, `unknown` is the 0-based unknown whose pivot failed.
std::int32_t bayesindent_cholesky_factor(const void *handle, void *work, const double *values, std::int32_t *unknown) {
  return static_cast<const analysis *>(handle)->factor(*static_cast<workspace *>(work), values, unknown);
}

// The lower Cholesky factor (kept x kept, column-major, zeros above) of the Schur complement of the kept unknowns.
void bayesindent_cholesky_kept_factor(const void *handle, const void *work, double *factor) {
  static_cast<const analysis *>(handle)->kept_factor(*static_cast<const workspace *>(work), factor);
}

// Overwrite the right-hand side `x` with the solution.
void bayesindent_cholesky_solve(const void *handle, void *work, double *x) {
  static_cast<const analysis *>(handle)->solve(*static_cast<workspace *>(work), x);
}
}
