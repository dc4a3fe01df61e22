!> Chains that a stopped run has kept: they come back to the bit, and only for what they were drawn
!> from.
program test_chain_checkpoints
   use abstract_sampler, only: chain_type, sampler_type
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
   type(chain_type) :: chain
   class(sampler_type), allocatable :: sampler
   type(error_type), allocatable :: error
   real(wp), target :: draws(2, 200), density(200)
   character(len=:), allocatable :: content
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

   do k = 11, 13
      call restore_chain(checkpoint, k, 200)
      call check('chain of stream '//to_text(k), chain%started &
         & .and. all(draws == whole%draws(:, :, k - 10)) &
         & .and. all(density == whole%log_density(:, k - 10)) &
         & .and. chain%acceptance == whole%acceptance(k - 10))
   end do
   call restore_chain(checkpoint, 14, 200)
   call check('there are no others', .not. chain%started)
   call restore_chain(checkpoint, 11, 100)
   call check('nor any of another length', .not. chain%started)
   call new_checkpoint(folder, inputs//' ', banana, other)
   call restore_chain(other, 11, 200)
   call check('nor any of other settings', .not. chain%started)
   call new_checkpoint(folder, inputs, other_banana, other)
   call restore_chain(other, 11, 200)
   call check('nor any of another density', .not. chain%started)

   ! What is kept is what is used: a chain in the place of another.
   draws = 0.25_wp
   chain%acceptance = 0.5_wp
   call checkpoint%store(12, chain)
   call sample_chains(banana, sampler, settings, again, error, checkpoint)
   call check('a kept chain is not drawn', all(again%draws(:, :, 2) == 0.25_wp) &
      & .and. again%acceptance(2) == 0.5_wp)
   call check('beside it all is as before', all(again%draws(:, :, ::2) == whole%draws(:, :, ::2)))

   call damage()
   call sample_chains(banana, sampler, settings, again, error, checkpoint)
   call check('a damaged one is drawn again', .not. allocated(error) &
      & .and. all(again%draws == whole%draws))
   call remove_files(folder, '.chain-')
   call restore_chain(checkpoint, 11, 200)
   call check('removed ones are gone', .not. chain%started)
   deallocate (content)
   call finish()

contains

   !> The chain of a stream, of some samples.
   subroutine restore_chain(kept, number, samples)
      type(checkpoint_type), intent(in) :: kept
      integer, intent(in) :: number, samples

      chain = chain_type(draws(:, :samples), density(:samples))
      call kept%restore(number, chain)
   end subroutine restore_chain

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
