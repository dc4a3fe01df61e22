!> Chains that a stopped run has kept: they come back to the bit, and only for what they were drawn
!> from.
program test_chain_checkpoints
   use abstract_sampler, only: sampler_type
   use errors, only: error_type
   use files, only: file_exists, make_folder, read_bytes, replace_file
   use kinds, only: wp
   use known_targets, only: banana_type
   use running_command, only: remove_files
   use samplers, only: chains_type, checkpoint_type, new_checkpoint, new_sampler, &
      & run_settings_type, sample_chains
   use testing, only: check, check_success, finish
   use text, only: to_text
   implicit none

   character(len=*), parameter :: folder = 'test_chain_checkpoints', inputs = '&sampler /'
   type(run_settings_type), parameter :: settings = run_settings_type(200, 3, 2, 7, 11)
   type(banana_type) :: banana, other_banana
   type(checkpoint_type) :: checkpoint, other
   type(chains_type) :: whole, kept, again
   type(sampler_type) :: sampler
   type(error_type), allocatable :: error
   real(wp), allocatable :: draws(:, :), density(:)
   character(len=:), allocatable :: content
   real(wp) :: share
   logical :: found
   integer :: k

   banana%dimension = 2
   banana%lower = [-1.5_wp, -10.0_wp]
   banana%upper = [2.0_wp, 10.0_wp]
   other_banana = banana
   other_banana%upper(1) = 2.000000001_wp
   call make_folder(folder, error)
   call remove_files(folder, '.chain-')
   call new_sampler('scmh', 100, sampler, error)
   call new_checkpoint(folder, inputs, banana, checkpoint)
   call sample_chains(banana, sampler, settings, whole, error, checkpoint_type())
   call sample_chains(banana, sampler, settings, kept, error, checkpoint)
   call check_success('chains are drawn and kept', error)
   call check('keeping changes nothing', &
      & all(whole%draws == kept%draws) .and. all(whole%log_density == kept%log_density) &
      & .and. all(whole%acceptance == kept%acceptance))
   call sample_chains(banana, sampler, settings, again, error, checkpoint)
   call check('they come back to the bit', &
      & all(whole%draws == again%draws) .and. all(whole%log_density == again%log_density) &
      & .and. all(whole%acceptance == again%acceptance))

   draws = whole%draws(:, :, 1)
   density = whole%log_density(:, 1)
   do k = 11, 13
      call checkpoint%restore(k, draws, density, share, found)
      call check('chain of stream '//to_text(k), found &
         & .and. all(draws == whole%draws(:, :, k - 10)) .and. share == whole%acceptance(k - 10))
   end do
   call checkpoint%restore(14, draws, density, share, found)
   call check('there are no others', .not. found)
   call checkpoint%restore(11, draws(:, :100), density(:100), share, found)
   call check('nor any of another length', .not. found)
   call new_checkpoint(folder, inputs//' ', banana, other)
   call other%restore(11, draws, density, share, found)
   call check('nor any of other settings', .not. found)
   call new_checkpoint(folder, inputs, other_banana, other)
   call other%restore(11, draws, density, share, found)
   call check('nor any of another density', .not. found)

   ! What is kept is what is used: a chain in the place of another.
   draws = 0.25_wp
   call checkpoint%store(12, draws, density, 0.5_wp)
   call sample_chains(banana, sampler, settings, again, error, checkpoint)
   call check('a kept chain is not drawn', all(again%draws(:, :, 2) == 0.25_wp) &
      & .and. again%acceptance(2) == 0.5_wp)
   call check('beside it all is as before', all(again%draws(:, :, ::2) == whole%draws(:, :, ::2)))

   call damage()
   call sample_chains(banana, sampler, settings, again, error, checkpoint)
   call check('a damaged one is drawn again', .not. allocated(error) &
      & .and. all(again%draws == whole%draws))
   call remove_files(folder, '.chain-')
   call checkpoint%restore(11, draws, density, share, found)
   call check('removed ones are gone', .not. found)
   deallocate (draws, density, content)
   call finish()

contains

   !> Of the chain of stream 12 a bit is changed.
   subroutine damage()
      character(len=:), allocatable :: path

      path = checkpoint%stem//'12'
      call check('the file of a chain', file_exists(path))
      call read_bytes(path, content, error)
      content(100:100) = achar(ieor(iachar(content(100:100)), 1))
      call replace_file(path, content, error)
   end subroutine damage
end program test_chain_checkpoints
