// What this processor can do, for a choice before OpenBLAS is loaded. A C interface, for Fortran
// and Python, without any library.
#include <cstdint>
#include <cstring>

extern "C" {

// The vector kernels that OpenBLAS shall use; '' where the choice is its own. It picks them from a
// list of the processors it knows and runs an unknown, younger one with the kernels of 2004, five
// times slower. What counts is the instruction set, which the processor states itself.
const char *bayesindent_blas_kernels() {
#ifdef __x86_64__
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
    return "SKYLAKEX";
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return "HASWELL";
#endif
  return "";
}

// Whether to use what was compiled for x86-64-v3, beside such `kernels`. A wheel has the core and
// the batch program twice, for any x86-64 processor and for x86-64-v3.
std::int32_t bayesindent_is_wide([[maybe_unused]] const char *kernels) {
#ifdef __x86_64__
  __builtin_cpu_init();
  return __builtin_cpu_supports("x86-64-v3") &&
         (std::strcmp(kernels, "HASWELL") == 0 || std::strcmp(kernels, "SKYLAKEX") == 0);
#else
  return 0;
#endif
}
}
