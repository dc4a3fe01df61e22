// The procedures of BLAS and LAPACK that the factorisation calls.
#ifndef BAYESINDENT_DENSE_KERNELS_H
#define BAYESINDENT_DENSE_KERNELS_H

extern "C" {
void spotrf_(const char *, const int *, float *, const int *, int *);
void strsv_(const char *, const char *, const char *, const int *, const float *, const int *, float *, const int *);
void sgemv_(const char *, const int *, const int *, const float *, const float *, const int *, const float *, const int *,
            const float *, float *, const int *);
void strtri_(const char *, const char *, const int *, float *, const int *, int *);
void ssyrk_(const char *, const char *, const int *, const int *, const float *, const float *, const int *, const float *, float *,
            const int *);
void sgemm_(const char *, const char *, const int *, const int *, const int *, const float *, const float *, const int *,
            const float *, const int *, const float *, float *, const int *);
}

#endif
