// The C interface: handles and statuses for the classes behind it.
#include "sparse_cholesky.h"

#include "multifrontal.h"

#include <new>
#ifdef __GLIBC__
#include <malloc.h>
#endif

extern "C" void openblas_set_num_threads(int) __attribute__((weak));

using bayesindent::analysis;
using bayesindent::workspace;

extern "C" {

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

void bayesindent_return_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

void bayesindent_cholesky_delete(void *handle) { delete static_cast<analysis *>(handle); }

void bayesindent_cholesky_size(const void *handle, double *entries, double *operations, double *bytes) {
  const auto *self = static_cast<const analysis *>(handle);
  *entries = self->entries;
  *operations = self->operations;
  *bytes = self->bytes;
}

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

std::int32_t bayesindent_cholesky_factor(const void *handle, void *work, const double *values, std::int32_t *unknown) {
  return static_cast<const analysis *>(handle)->factor(*static_cast<workspace *>(work), values, unknown);
}

void bayesindent_cholesky_kept_factor(const void *handle, const void *work, double *factor) {
  static_cast<const analysis *>(handle)->kept_factor(*static_cast<const workspace *>(work), factor);
}

void bayesindent_cholesky_solve(const void *handle, void *work, double *x) {
  static_cast<const analysis *>(handle)->solve(*static_cast<workspace *>(work), x);
}
}
