// Locks and signals of a running command: an output folder to itself, and an immediate end on a
// signal. A C interface for Fortran.
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
#include <sys/resource.h>
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
// Two copies of each: a signal may arrive while one of them is written.
char message[2][longest], log_file[2][longest];
std::atomic<int> current{0};
std::atomic<bool> ending{false};
long seconds_east = 0;

int descriptor = -1;

// A line of text. Only such functions as these may be called in a handler of signals. `add` appends
// a text, or a number with at least the given digits.
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

// Adds the local time in the format of the log: '2026-11-22 07:00:00,000'.
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
  for (const watched_signal &entry : watched)
    if (entry.number == signal)
      line.add(entry.name);
  line.add(message[current]);
  line.add("\n");
}

// Handler that ends the process. Work in progress is lost, but results are complete files and
// transactions at every moment.
void end_at_once(int signal) {
  // Another thread may receive the next signal.
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
  // The reader of standard error may have ended.
  std::signal(SIGPIPE, SIG_IGN);
  line_buffer line;
  add_reason(line, signal);
  line.send(STDERR_FILENO);
  _exit(128 + signal);
}

std::mutex listening;
int listeners = 0;
bool records = false;
struct sigaction handler_before;
std::atomic<bool> requested{false};

void record_signal(int signal, siginfo_t *information, void *context) {
  requested = true;
  if ((handler_before.sa_flags & SA_SIGINFO) != 0)
    handler_before.sa_sigaction(signal, information, context);
  else
    handler_before.sa_handler(signal);
}

// Removes the files of a folder whose names begin with a prefix, if `removed` is true for the rest
// of the name.
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

// From now on SIGINT, SIGTERM and SIGHUP end the process with status 128 + signal and one line on
// standard error and in the log of the folder, if there is one. Ignored signals stay ignored.
// Another call changes the line.
void watch(const std::string &folder, bool resumes) {
  const int other = 1 - current;
  const std::string continuation = resumes ? "; what was finished is kept in " + folder +
                                                 ", and the same command goes on from there"
                                           : "; the same command begins anew";
  std::snprintf(message[other], longest, "%s", continuation.c_str());
  std::snprintf(log_file[other], longest, "%s",
                folder.empty() ? "" : (folder + "/run.log").c_str());
  const std::time_t now = std::time(nullptr);
  std::tm local;
  if (localtime_r(&now, &local) != nullptr)
    seconds_east = local.tm_gmtoff;
  current = other;
  struct sigaction action = {};
  action.sa_handler = end_at_once;
  for (const watched_signal &entry : watched)
    sigaddset(&action.sa_mask, entry.number);
  for (watched_signal &entry : watched)
    if (!entry.taken && sigaction(entry.number, nullptr, &entry.before) == 0 &&
        entry.before.sa_handler != SIG_IGN)
      entry.taken = sigaction(entry.number, &action, nullptr) == 0;
  // Exceeding the limit of file sizes becomes a failed write, like a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
}

void unlock() {
  if (descriptor >= 0)
    close(descriptor);
  descriptor = -1;
}

// Waits at most `milliseconds` for the lock of a file, which is created and stores the number of
// the locking process; the system releases the lock when that process ends. Returns 0: locked; 1:
// locked by the process `holder` (0: unknown); 2: the file cannot be opened. A file system without
// locks counts as locked.
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
  // The number only serves a message: continue if the disk is full.
  if (ftruncate(opened, 0) == 0)
    dprintf(opened, "%ld\n", static_cast<long>(getpid()));
  descriptor = opened;
  return 0;
}

// Whether the stack of the process or those of its threads are smaller than 1 MB.
bool has_small_stacks() {
  rlimit limit{};
  getrlimit(RLIMIT_STACK, &limit);
  const char *const stated = std::getenv("OMP_STACKSIZE");
  // Kilobytes, if no unit follows.
  unsigned size = 1024;
  char unit = 'k';
  if (stated != nullptr)
    std::sscanf(stated, "%u %c", &size, &unit);
  return limit.rlim_cur >> 20 == 0 || (size < 1024 && (unit | ' ') == 'k');
}

} // namespace

extern "C" {

// A closed standard stream becomes /dev/null, so that no file which is opened later takes its
// place. A program whose stacks are too small ends here.
void bayesindent_watch_signals() {
  for (int stream = 0; stream < 3; ++stream)
    if (fcntl(stream, F_GETFD) < 0)
      open("/dev/null", O_RDWR);
  if (has_small_stacks()) {
    dprintf(2, "stacks of less than 1 MB: set ulimit -s 8192 and OMP_STACKSIZE=8M\n");
    std::exit(1);
  }
  watch("", false);
}

// Waits for the lock of an output folder and returns the status of `lock`. Afterwards signals are
// also written to the log of the folder, and files that killed processes left unfinished are
// removed: their names consist of `prefix`, the number of a process that has ended, '-', and more.
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

// Removes all files of a folder whose names begin with `prefix`.
void bayesindent_remove_files(const char *folder, const char *prefix) {
  remove_files(folder, prefix, [](const char *) { return true; });
}

// Releases the folder and restores the handlers of signals.
void bayesindent_end_command() {
  for (watched_signal &entry : watched)
    if (entry.taken)
      entry.taken = sigaction(entry.number, &entry.before, nullptr) != 0;
  unlock();
}

// While the library listens, SIGINT is recorded before its handler is called. Nothing changes if
// SIGINT has no handler, or if a command watches it. Threads may listen at the same time; the last
// one to stop forgets a recorded signal.
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
  action.sa_sigaction = record_signal;
  action.sa_flags |= SA_SIGINFO;
  records = sigaction(SIGINT, &action, nullptr) == 0;
}

void bayesindent_stop_listening() {
  const std::lock_guard<std::mutex> guard(listening);
  if (--listeners > 0)
    return;
  requested = false;
  if (!records)
    return;
  struct sigaction present;
  // Another handler may have been set meanwhile.
  if (sigaction(SIGINT, nullptr, &present) == 0 && (present.sa_flags & SA_SIGINFO) != 0 &&
      present.sa_sigaction == record_signal)
    sigaction(SIGINT, &handler_before, nullptr);
  records = false;
}

bool bayesindent_stop_requested() { return requested; }
}
