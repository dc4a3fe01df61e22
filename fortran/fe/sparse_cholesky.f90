!> Fortran interface to the C++ code that factors many sparse matrices with the same pattern
!> (cpp/sparse_cholesky.cpp).
module sparse_cholesky
   use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_int32_t, c_null_ptr, c_ptr
   use errors, only: error_type, raise
   use kinds, only: wp
   use machine, only: check_memory, free_memory, memory_text, raise_no_memory
   use text, only: to_text
   implicit none
   private
   public :: cholesky_type, analyse_pattern, free_analysis, acquire_factor, release_factor
   public :: factorise, retained_factor, solve_factored

   !> The symbolic analysis of a pattern. It does not change once made, so threads share it.
   type :: cholesky_type
      type(c_ptr) :: handle = c_null_ptr
      integer :: n = 0
      !> Entries of the factor, floating-point operations of one factorisation, and bytes of one
      !> workspace.
      real(wp) :: entries = 0.0_wp, operations = 0.0_wp, bytes = 0.0_wp
   end type cholesky_type

   integer(c_int32_t), parameter :: status_ok = 0, status_indefinite = 1, status_no_memory = 2

   interface
      type(c_ptr) function c_new(n, column_start, row, group, retained, sizes, status) bind(c, &
         & name='bayesindent_cholesky_new')
         import
         integer(c_int32_t), value :: n, retained
         integer(c_int32_t), intent(in) :: column_start(*), row(*), group(*)
         real(c_double), intent(out) :: sizes(3)
         integer(c_int32_t), intent(out) :: status
      end function c_new
      subroutine c_delete(analysis) bind(c, name='bayesindent_cholesky_delete')
         import
         type(c_ptr), value :: analysis
      end subroutine c_delete
      type(c_ptr) function c_acquire(analysis, free_bytes) bind(c, &
         & name='bayesindent_cholesky_acquire')
         import
         type(c_ptr), value :: analysis
         real(c_double), value :: free_bytes
      end function c_acquire
      !> Return a workspace to its analysis.
      subroutine release_factor(analysis, workspace) bind(c, name='bayesindent_cholesky_release')
         import
         type(c_ptr), value :: analysis, workspace
      end subroutine release_factor
      integer(c_int32_t) function c_factor(analysis, workspace, values, unknown) bind(c, &
         & name='bayesindent_cholesky_factor')
         import
         type(c_ptr), value :: analysis, workspace
         real(c_double), intent(in) :: values(*)
         integer(c_int32_t), intent(out) :: unknown
      end function c_factor
      !> Lower Cholesky factor of the Schur complement of the retained unknowns, with zeros above
      !> the diagonal.
      subroutine retained_factor(analysis, workspace, factor) &
         & bind(c, name='bayesindent_cholesky_retained_factor')
         import
         type(c_ptr), value :: analysis, workspace
         real(c_double), intent(out) :: factor(*)
      end subroutine retained_factor
      !> Overwrite the right-hand sides x (unknowns, count) with the solutions.
      subroutine solve_factored(analysis, workspace, count, x) &
         & bind(c, name='bayesindent_cholesky_solve')
         import
         type(c_ptr), value :: analysis, workspace
         integer(c_int32_t), value :: count
         real(c_double), intent(inout) :: x(*)
      end subroutine solve_factored
   end interface

contains

   !> Order and analyse the pattern of a lower triangle in compressed columns, 1-based.
   subroutine analyse_pattern(column_start, row, group, retained, cholesky, error)
      !> First entry of each column, and rows of the entries; number of the mesh node of each
      !> unknown (unknowns of a node share their neighbours); number of retained unknowns, the last
      !> ones, which are eliminated last.
      integer, intent(in) :: column_start(:), row(:), group(:), retained
      type(cholesky_type), intent(out) :: cholesky
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: sizes(3)
      integer(c_int32_t) :: status

      cholesky%n = size(group)
      cholesky%handle = c_new(cholesky%n, column_start - 1, row - 1, group - 1, retained, &
         & sizes, status)
      if (status == status_no_memory) then
         call raise_no_memory('the factor of a system of '//to_text(cholesky%n)//' unknowns', error)
      else if (status /= status_ok) then
         call raise(error, 'the sparsity pattern of '//to_text(cholesky%n) &
            & //' unknowns could not be analysed (status '//to_text(int(status))//')')
      end if
      if (allocated(error)) return
      cholesky%entries = sizes(1)
      cholesky%operations = sizes(2)
      cholesky%bytes = sizes(3)
      call check_memory(cholesky%bytes, &
         & 'the factor of a system of '//to_text(cholesky%n)//' unknowns', error)
      if (allocated(error)) call free_analysis(cholesky)
   end subroutine analyse_pattern

   subroutine free_analysis(cholesky)
      type(cholesky_type), intent(inout) :: cholesky

      if (c_associated(cholesky%handle)) call c_delete(cholesky%handle)
      cholesky%handle = c_null_ptr
   end subroutine free_analysis

   !> Acquire a workspace for one factor; `release_factor` returns it.
   subroutine acquire_factor(cholesky, factor, error)
      type(cholesky_type), intent(in) :: cholesky
      type(c_ptr), intent(out) :: factor
      type(error_type), allocatable, intent(out) :: error

      ! Another thread must not allocate between the measurement of the free memory and its use.
      !$omp critical (sparse_cholesky)
      factor = c_acquire(cholesky%handle, free_memory())
      !$omp end critical (sparse_cholesky)
      if (.not. c_associated(factor)) then
         call raise_no_memory('a factor of '//memory_text(cholesky%bytes) &
            & //'; fewer workers or a lower refine need less', error)
      end if
   end subroutine acquire_factor

   !> Factor the matrix with these values; report a matrix that is not positive definite.
   subroutine factorise(cholesky, factor, values, error)
      type(cholesky_type), intent(in) :: cholesky
      type(c_ptr), intent(in) :: factor
      !> In the order of the rows of the pattern.
      real(wp), intent(in), contiguous :: values(:)
      type(error_type), allocatable, intent(out) :: error
      integer(c_int32_t) :: status, unknown

      status = c_factor(cholesky%handle, factor, values, unknown)
      if (status == status_indefinite) then
         call raise(error, 'the stiffness matrix is not positive definite (unknown ' &
            & //to_text(int(unknown) + 1)//' of '//to_text(cholesky%n)//')')
      end if
   end subroutine factorise
end module sparse_cholesky
