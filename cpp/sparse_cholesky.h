// Sparse Cholesky factorisation of many matrices with one pattern: a C interface, for Fortran.
//
// The lower triangle of a symmetric matrix is given in compressed columns, 0-based, diagonal included. The last `kept`
// unknowns are eliminated last, so that the trailing block of the factor is that of their Schur complement.
// An analysis is read-only once made and may be shared by threads; each thread acquires a workspace of its own.
#ifndef BAYESINDENT_SPARSE_CHOLESKY_H
#define BAYESINDENT_SPARSE_CHOLESKY_H

#include <cstdint>

extern "C" {

enum bayesindent_cholesky_status {
  bayesindent_cholesky_ok = 0,
  bayesindent_cholesky_indefinite = 1,
  bayesindent_cholesky_no_memory = 2,
  bayesindent_cholesky_bad_input = 3,
  bayesindent_cholesky_internal = 4
};

// `group[i]` numbers (from 0) the mesh node of unknown i: unknowns of a node share their neighbours, and the ordering
// works on nodes. Returns null on failure, with the reason in `status`.
void *bayesindent_cholesky_new(std::int32_t n, const std::int32_t *column_start, const std::int32_t *row, const std::int32_t *group,
                               std::int32_t kept, std::int32_t *status);
void bayesindent_cholesky_delete(void *analysis);

// What is free goes back to the system, where the C library can: an analysis needs much for a short time.
void bayesindent_return_memory();

// Entries of the factor, floating point operations of one factorisation, and bytes of one workspace.
void bayesindent_cholesky_size(const void *analysis, double *entries, double *operations, double *bytes);

// A workspace: a released one, else a new one if less than `free_bytes` suffice. Returns null where memory does not suffice.
void *bayesindent_cholesky_acquire(void *analysis, double free_bytes);
void bayesindent_cholesky_release(void *analysis, void *workspace);

// Factor the matrix with these values (order of `row`). On `indefinite`, `unknown` is the 0-based unknown whose pivot failed.
std::int32_t bayesindent_cholesky_factor(const void *analysis, void *workspace, const double *values, std::int32_t *unknown);

// The lower Cholesky factor (kept x kept, column-major, zeros above) of the Schur complement of the kept unknowns.
void bayesindent_cholesky_kept_factor(const void *analysis, const void *workspace, double *factor);

// Overwrite the right-hand side `x` with the solution.
void bayesindent_cholesky_solve(const void *analysis, void *workspace, double *x);
}

#endif
