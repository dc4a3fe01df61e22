// What a running command has of the operating system: an output folder to itself, and an end at
// once on a signal. A C interface, for Fortran.
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fcntl.h>
#include <filesystem>
#include <mutex>
#include <string>
#include <sys/file.h>
#include <unistd.h>

#include <csignal>

namespace {

struct watched_signal {
  int number;
  const char *name;
  bool taken = false;
  struct sigaction before = {};
};
watched_signal watched[] = {{SIGINT, "SIGINT"}, {SIGTERM, "SIGTERM"}, {SIGHUP, "SIGHUP"}};

constexpr std::size_t longest = 8192;
// Two of each, so that what a signal reads is never half-written.
char words[2][longest], log_file[2][longest];
std::atomic<int> current{0};
std::atomic<bool> ending{false};
long seconds_east = 0;

int descriptor = -1;

// Appends a text, or a number of at least so many digits: nothing but this may be called in a
// handler.
struct line_buffer {
  char text[longest + 128];
  std::size_t length = 0;

  void add(const char *piece) {
    while (*piece != '\0' && length < sizeof text)
      text[length++] = *piece++;
  }
  void add(long number, int digits) {
    char reversed[24];
    int n = 0;
    for (; number > 0 || n < digits; number /= 10)
      reversed[n++] = static_cast<char>('0' + number % 10);
    while (n > 0 && length < sizeof text)
      text[length++] = reversed[--n];
  }
  void send(int to) const {
    for (std::size_t sent = 0; sent < length;) {
      const ssize_t now = write(to, text + sent, length - sent);
      if (now <= 0)
        return;
      sent += static_cast<std::size_t>(now);
    }
  }
};

// '2026-11-22 07:00:00,000' of the local clock, as the log writes it.
void add_time(line_buffer &line) {
  using namespace std::chrono;
  timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  const sys_seconds local{seconds{now.tv_sec + seconds_east}};
  const sys_days day = floor<days>(local);
  const year_month_day date{day};
  const hh_mm_ss time{local - day};
  const long numbers[] = {static_cast<int>(date.year()),
                          static_cast<unsigned>(date.month()),
                          static_cast<unsigned>(date.day()),
                          time.hours().count(),
                          time.minutes().count(),
                          time.seconds().count(),
                          now.tv_nsec / 1000000};
  const char *const before[] = {"", "-", "-", " ", ":", ":", ","};
  for (int i = 0; i < 7; ++i) {
    line.add(before[i]);
    line.add(numbers[i], i == 0 ? 4 : i == 6 ? 3 : 2);
  }
}

void add_reason(line_buffer &line, int signal) {
  line.add("stopped by ");
  for (const watched_signal &one : watched)
    if (one.number == signal)
      line.add(one.name);
  line.add(words[current]);
  line.add("\n");
}

// What is under way is given up: results are whole files and whole transactions at every moment.
void end_at_once(int signal) {
  // Another thread may take the next one.
  while (ending.exchange(true))
    pause();
  if (log_file[current][0] != '\0') {
    const int log = open(log_file[current],
                         O_WRONLY | O_APPEND | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
    line_buffer line;
    add_time(line);
    line.add(" WARNING ");
    add_reason(line, signal);
    line.send(log);
  }
  // Nobody may be reading any more.
  std::signal(SIGPIPE, SIG_IGN);
  line_buffer line;
  add_reason(line, signal);
  line.send(STDERR_FILENO);
  _exit(128 + signal);
}

std::mutex listening;
int listeners = 0;
bool listens = false;
struct sigaction handler_before;
std::atomic<bool> requested{false};

void note(int signal, siginfo_t *information, void *context) {
  requested = true;
  if ((handler_before.sa_flags & SA_SIGINFO) != 0)
    handler_before.sa_sigaction(signal, information, context);
  else
    handler_before.sa_handler(signal);
}

// Remove the files of a folder that begin with a prefix, if so says a question about the rest of
// the name.
template <typename question>
void remove_files(const char *folder, const std::string &prefix, question removed) {
  std::error_code failed;
  for (std::filesystem::directory_iterator entry(folder, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(prefix) && removed(name.c_str() + prefix.size()))
      unlink(entry->path().c_str());
  }
}

// From now on SIGINT, SIGTERM and SIGHUP end the process with status 128 + signal, unless they are
// ignored: one line on standard error and in the log of the folder, if there is one. Calling it
// again changes the line.
void watch(const std::string &folder, bool resumes) {
  const int other = 1 - current;
  const std::string kept = resumes ? "; what was finished is kept in " + folder +
                                         ", and the same command goes on from there"
                                   : "; the same command begins anew";
  std::snprintf(words[other], longest, "%s", kept.c_str());
  std::snprintf(log_file[other], longest, "%s",
                folder.empty() ? "" : (folder + "/run.log").c_str());
  const std::time_t now = std::time(nullptr);
  std::tm local;
  if (localtime_r(&now, &local) != nullptr)
    seconds_east = local.tm_gmtoff;
  current = other;
  struct sigaction action = {};
  action.sa_handler = end_at_once;
  for (const watched_signal &one : watched)
    sigaddset(&action.sa_mask, one.number);
  for (watched_signal &one : watched)
    if (!one.taken && sigaction(one.number, nullptr, &one.before) == 0 &&
        one.before.sa_handler != SIG_IGN)
      one.taken = sigaction(one.number, &action, nullptr) == 0;
  // A file that is larger than the limit is a write that fails, like that on a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
}

void unlock() {
  if (descriptor >= 0)
    close(descriptor);
  descriptor = -1;
}

// Wait at most `milliseconds` for the lock of a file, which is made and has the process that holds
// it; the system frees the lock with that process. 0: locked; 1: process `holder` (0: unknown) has
// it; 2: the file cannot be opened. A file system without locks counts as locked.
std::int32_t lock(const std::string &file, std::int32_t milliseconds, std::int32_t *holder) {
  constexpr std::int32_t step = 20;
  *holder = 0;
  unlock();
  const int opened = open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
  if (opened < 0)
    return 2;
  while (flock(opened, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EINTR)
      continue;
    if (errno != EWOULDBLOCK)
      break;
    if (milliseconds <= 0) {
      char text[32] = "";
      if (pread(opened, text, sizeof text - 1, 0) > 0)
        *holder = static_cast<std::int32_t>(std::strtol(text, nullptr, 10));
      close(opened);
      return 1;
    }
    usleep(1000 * step);
    milliseconds -= step;
  }
  // Who it is only serves the message: a full disk is no reason to stop here.
  if (ftruncate(opened, 0) == 0)
    dprintf(opened, "%ld\n", static_cast<long>(getpid()));
  descriptor = opened;
  return 0;
}

} // namespace

extern "C" {

void bayesindent_watch_signals() { watch("", false); }

// Wait for the lock of an output folder and say as it does what became of it. Then a signal is told
// in its log, too, and the files are removed whose names are `prefix`, a process that is no more,
// and '-', and so on: what killed processes left half-written.
std::int32_t bayesindent_take_folder(const char *folder, const char *prefix,
                                     std::int32_t milliseconds, std::int32_t resumes,
                                     std::int32_t *holder) {
  const std::int32_t status = lock(std::string(folder) + "/.lock", milliseconds, holder);
  if (status != 0)
    return status;
  remove_files(folder, prefix, [](const char *rest) {
    char *after;
    const long process = std::strtol(rest, &after, 10);
    return process > 0 && *after == '-' && kill(static_cast<pid_t>(process), 0) != 0 &&
           errno == ESRCH;
  });
  watch(folder, resumes != 0);
  return status;
}

// Remove all files of a folder whose names begin so.
void bayesindent_remove_files(const char *folder, const char *prefix) {
  remove_files(folder, prefix, [](const char *) { return true; });
}

// Leave the folder to others, and signals to what they did before.
void bayesindent_end_command() {
  for (watched_signal &one : watched)
    if (one.taken)
      one.taken = sigaction(one.number, &one.before, nullptr) != 0;
  unlock();
}

// While somebody listens, SIGINT is noted before it goes to the handler that it had; without a
// handler, or where a command watches, nothing is changed. Threads may listen at the same time;
// with the last what was noted is forgotten.
void bayesindent_listen() {
  const std::lock_guard<std::mutex> guard(listening);
  if (listeners++ > 0)
    return;
  if (sigaction(SIGINT, nullptr, &handler_before) != 0)
    return;
  const auto handler = handler_before.sa_handler;
  if (handler == SIG_DFL || handler == SIG_IGN || handler == end_at_once)
    return;
  struct sigaction action = handler_before;
  action.sa_sigaction = note;
  action.sa_flags |= SA_SIGINFO;
  listens = sigaction(SIGINT, &action, nullptr) == 0;
}

void bayesindent_stop_listening() {
  const std::lock_guard<std::mutex> guard(listening);
  if (--listeners > 0)
    return;
  requested = false;
  if (!listens)
    return;
  struct sigaction present;
  // Somebody may have set another one meanwhile.
  if (sigaction(SIGINT, nullptr, &present) == 0 && (present.sa_flags & SA_SIGINFO) != 0 &&
      present.sa_sigaction == note)
    sigaction(SIGINT, &handler_before, nullptr);
  listens = false;
}

bool bayesindent_stop_requested() { return requested; }
}
