#include "running_command.h"

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <dirent.h>
#include <fcntl.h>
#include <mutex>
#include <sys/file.h>
#include <unistd.h>

#include <csignal>

namespace {

struct watched_signal {
  int number;
  const char *name;
};
constexpr watched_signal watched[] = {{SIGINT, "SIGINT"}, {SIGTERM, "SIGTERM"}, {SIGHUP, "SIGHUP"}};
struct sigaction before[3];
bool taken[3] = {false, false, false};

constexpr std::size_t longest = 8192;
// Two of each, so that what a signal reads is never half-written.
char words[2][longest], log_file[2][longest];
std::atomic<int> current{0};
std::atomic<bool> ending{false};
bool on_terminal = false;
long seconds_east = 0;

int descriptor = -1;

// Appends a text, or a number of at least so many digits: nothing but this may be called in a handler.
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

// '2026-11-22 07:00:00,000' of the local clock, as the log writes it. The days of the calendar after H. Hinnant, chrono-compatible
// low-level date algorithms: years that begin in March, eras of 400.
void add_time(line_buffer &line) {
  timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  const long local = now.tv_sec + seconds_east, second = local % 86400, days = local / 86400 + 719468;
  const long era = days / 146097, of_era = days % 146097;
  const long year = (of_era - of_era / 1460 + of_era / 36524 - of_era / 146096) / 365,
             of_year = of_era - (365 * year + year / 4 - year / 100);
  const long shifted = (5 * of_year + 2) / 153, month = shifted < 10 ? shifted + 3 : shifted - 9;
  line.add(year + 400 * era + (month <= 2 ? 1 : 0), 4);
  line.add("-");
  line.add(month, 2);
  line.add("-");
  line.add(of_year - (153 * shifted + 2) / 5 + 1, 2);
  line.add(" ");
  line.add(second / 3600, 2);
  line.add(":");
  line.add(second / 60 % 60, 2);
  line.add(":");
  line.add(second % 60, 2);
  line.add(",");
  line.add(now.tv_nsec / 1000000, 3);
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
    const int log = open(log_file[current], O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666);
    line_buffer line;
    add_time(line);
    line.add(" WARNING ");
    add_reason(line, signal);
    line.send(log);
  }
  // Nobody may be reading any more.
  std::signal(SIGPIPE, SIG_IGN);
  line_buffer line;
  // A bar of progress has hidden the cursor.
  line.add(on_terminal ? "\r\033[?25h\n" : "");
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

// Remove the files of a folder that begin with a prefix, if so says a question about the rest of the name.
template <typename question> void remove_files(const char *folder, const char *prefix, question removed) {
  DIR *listing = opendir(folder);
  if (listing == nullptr)
    return;
  const std::size_t length = std::strlen(prefix);
  while (const dirent *entry = readdir(listing))
    if (std::strncmp(entry->d_name, prefix, length) == 0 && removed(entry->d_name + length))
      unlinkat(dirfd(listing), entry->d_name, 0);
  closedir(listing);
}

} // namespace

extern "C" {

void bayesindent_watch_signals(const char *new_words, const char *log) {
  const int other = 1 - current;
  std::snprintf(words[other], longest, "%s", new_words);
  std::snprintf(log_file[other], longest, "%s", log);
  const std::time_t now = std::time(nullptr);
  std::tm local;
  if (localtime_r(&now, &local) != nullptr)
    seconds_east = local.tm_gmtoff;
  on_terminal = isatty(STDERR_FILENO) != 0;
  current = other;
  struct sigaction action = {};
  action.sa_handler = end_at_once;
  for (const watched_signal &one : watched)
    sigaddset(&action.sa_mask, one.number);
  for (int i = 0; i < 3; i++) {
    if (taken[i] || sigaction(watched[i].number, nullptr, &before[i]) != 0 || before[i].sa_handler == SIG_IGN)
      continue;
    taken[i] = sigaction(watched[i].number, &action, nullptr) == 0;
  }
}

void bayesindent_unwatch_signals() {
  for (int i = 0; i < 3; i++)
    if (taken[i])
      taken[i] = sigaction(watched[i].number, &before[i], nullptr) != 0;
}

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
  if (sigaction(SIGINT, nullptr, &present) == 0 && (present.sa_flags & SA_SIGINFO) != 0 && present.sa_sigaction == note)
    sigaction(SIGINT, &handler_before, nullptr);
  listens = false;
}

std::int32_t bayesindent_stop_requested() { return requested ? 1 : 0; }

std::int32_t bayesindent_lock_file(const char *file, std::int32_t milliseconds, std::int32_t *holder) {
  constexpr std::int32_t step = 20;
  *holder = 0;
  bayesindent_unlock_file();
  const int opened = open(file, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
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
  char text[32];
  const int length = std::snprintf(text, sizeof text, "%ld\n", static_cast<long>(getpid()));
  // Who it is only serves the message: a full disk is no reason to stop here.
  if (pwrite(opened, text, static_cast<std::size_t>(length), 0) == length && ftruncate(opened, length) != 0)
    errno = 0;
  descriptor = opened;
  return 0;
}

void bayesindent_unlock_file() {
  if (descriptor >= 0)
    close(descriptor);
  descriptor = -1;
}

void bayesindent_remove_remains(const char *folder, const char *prefix) {
  remove_files(folder, prefix, [](const char *rest) {
    char *after;
    const long process = std::strtol(rest, &after, 10);
    return process > 0 && *after == '-' && kill(static_cast<pid_t>(process), 0) != 0 && errno == ESRCH;
  });
}

void bayesindent_remove_files(const char *folder, const char *prefix) {
  remove_files(folder, prefix, [](const char *) { return true; });
}
}
