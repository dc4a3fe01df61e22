// What a running command has of the operating system: an output folder to itself, and an end at once on a signal. A C interface,
// for Fortran.
#ifndef BAYESINDENT_RUNNING_COMMAND_H
#define BAYESINDENT_RUNNING_COMMAND_H

#include <cstdint>

extern "C" {

// From now on SIGINT, SIGTERM and SIGHUP end the process with status 128 + signal, unless they are ignored: one line of `words`
// after the name of the signal on standard error and at the end of the file `log` (none if empty). Calling it again changes the
// words.
void bayesindent_watch_signals(const char *words, const char *log);

// The signals do what they did before.
void bayesindent_unwatch_signals();

// Wait at most `milliseconds` for the lock of `file`, which is made and has the process that holds it; the system frees the lock
// with that process. 0: locked; 1: process `holder` (0: unknown) has it; 2: the file cannot be opened. A file system without locks
// counts as locked.
std::int32_t bayesindent_lock_file(const char *file, std::int32_t milliseconds, std::int32_t *holder);

void bayesindent_unlock_file();

// Remove the files of a folder whose names are `prefix`, a process that is no more, and '-', and so on: what killed processes left
// half-written.
void bayesindent_remove_remains(const char *folder, const char *prefix);

// While somebody listens, SIGINT is noted before it goes to the handler that it had; without a handler, or where a command watches,
// nothing is changed. Threads may listen at the same time; with the last what was noted is forgotten.
void bayesindent_listen();
void bayesindent_stop_listening();
std::int32_t bayesindent_stop_requested();

// Remove all files of a folder whose names begin so.
void bayesindent_remove_files(const char *folder, const char *prefix);
}

#endif
