// Instruction sets of this processor, from which the kernels of OpenBLAS are chosen before it is
// loaded. A C interface for Fortran and Python that needs no library.
#include <cstdint>
#include <cstring>

extern "C" {

// The vector kernels that OpenBLAS is to use; '' leaves the choice to OpenBLAS. OpenBLAS chooses
// from a list of known processors, and runs a newer one with the kernels of 2004, which are five
// times slower. The instruction sets, which the processor reports itself, decide here.
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

// Whether to use the code compiled for x86-64-v3, given these `kernels`. A wheel has the core and
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
