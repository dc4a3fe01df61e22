!> What makes two simulations the same physics: one line of JSON, keys sorted, under which campaigns store their results.
!>
!> Stored texts are compared as they are: what changes here orphans every campaign. So what came to the settings later is left out
!> at the value that it had before.
module physics_identity
   use fe_indentation, only: numerics_revision
   use kinds, only: wp
   use numbers, only: number_text
   use settings_groups, only: simulation_settings_type
   use text, only: to_text
   implicit none
   private
   public :: identity_text

   !> Of the half-space before there were the variables.
   real(wp), parameter :: first_outer = 5.0_wp, first_growth = 1.13_wp

contains

   !> The identity of the physics of &simulation.
   function identity_text(settings) result(identity)
      type(simulation_settings_type), intent(in) :: settings
      character(len=:), allocatable :: identity

      identity = '{'
      if (settings%simulator == 'fe') then
         identity = identity//'"depths": '//to_text(settings%depths)//', "element": "'//settings%element//'", ' &
            & //'"estimator": "least squares through the origin", "extrapolate": ' &
            & //trim(merge('true ', 'false', settings%extrapolate))//', '
         if (abs(settings%growth - first_growth) > 0.0_wp) identity = identity//'"growth": '//number_text(settings%growth)//', '
         identity = identity//'"integration": "'//settings%integration//'", "mesh": "'//settings%mesh//'", "numerics": ' &
            & //to_text(numerics_revision)//', '
         if (abs(settings%outer - first_outer) > 0.0_wp) identity = identity//'"outer": '//number_text(settings%outer)//', '
         identity = identity//'"radius_um": '//number_text(settings%radius_um)//', "refine": '//number_text(settings%refine)//', '
      end if
      identity = identity//'"simulator": "'//settings%simulator//'"}'
   end function identity_text
end module physics_identity
