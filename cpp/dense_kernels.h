// The procedures of BLAS and LAPACK that the factorisation calls.
#ifndef BAYESINDENT_DENSE_KERNELS_H
#define BAYESINDENT_DENSE_KERNELS_H

extern "C" {
void dpotrf_(const char *, const int *, double *, const int *, int *);
void dtrsv_(const char *, const char *, const char *, const int *, const double *, const int *, double *, const int *);
void dgemv_(const char *, const int *, const int *, const double *, const double *, const int *, const double *, const int *,
            const double *, double *, const int *);
void dtrtri_(const char *, const char *, const int *, double *, const int *, int *);
void dsyrk_(const char *, const char *, const int *, const int *, const double *, const double *, const int *, const double *,
            double *, const int *);
void dgemm_(const char *, const char *, const int *, const int *, const int *, const double *, const double *, const int *,
            const double *, const int *, const double *, double *, const int *);
}

#endif
