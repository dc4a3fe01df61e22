// Services of the operating system other than signals: files, memory, the location of the program.
// A C interface for Fortran.
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <glob.h>
#include <limits>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <mutex>
#include <sstream>
#include <string>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

extern "C" {
const char *bayesindent_blas_kernels();
std::int32_t bayesindent_is_wide(const char *kernels);
// Procedures of OpenBLAS: a buffer for one caller, which is returned for the next one.
void *blas_memory_alloc(int) __attribute__((weak));
void blas_memory_free(void *) __attribute__((weak));
}

namespace {

// The bytes of the last file that was read, until they are taken.
thread_local std::string contents;

// The first number after a key at the beginning of a line; infinite if there is none.
double entry(const char *path, const std::string &key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    double number;
    if (line.compare(0, key.size(), key) == 0 &&
        std::istringstream(line.substr(key.size())) >> number)
      return number;
  }
  return std::numeric_limits<double>::infinity();
}

// The reason why a file cannot be written.
const char *reason_of(int error) {
  return error == ENOSPC  ? "the disk is full"
         : error == EFBIG ? "larger than files may be here"
                          : std::strerror(error);
}

// The folder of this program.
std::filesystem::path own_folder() {
  std::error_code failed;
  return std::filesystem::read_symlink("/proc/self/exe", failed).parent_path();
}

// The package's data in a Python beside this program, the last one by name; '' if there are none.
// Debian's Python installs into other folders than it reports when the package is built.
std::string other_packages() {
  const char *const places = "../lib*/python3*/{site,dist}-packages/bayesindent/data/";
  glob_t found = {};
  glob((own_folder() / places).c_str(), GLOB_BRACE | GLOB_ONLYDIR, nullptr, &found);
  const std::string last = found.gl_pathc > 0 ? found.gl_pathv[found.gl_pathc - 1] : "";
  globfree(&found);
  return last;
}

// Replaces this process by the program of a file, with the same arguments; returns if that fails.
void restart(const std::string &file) {
  std::ifstream started("/proc/self/cmdline");
  std::string line(std::istreambuf_iterator<char>(started), {});
  std::vector<char *> arguments;
  for (std::size_t at = 0; at < line.size(); at = line.find('\0', at) + 1)
    arguments.push_back(&line[at]);
  arguments.push_back(nullptr);
  execv(file.c_str(), arguments.data());
}

} // namespace

extern "C" {

// Reads a file of `length` bytes, but not much more than `largest`; bayesindent_take_bytes takes
// the bytes. Returns 1 if it cannot be opened, 2 if it cannot be read, 3 for a device or a pipe.
std::int32_t bayesindent_read_file(const char *path, std::int32_t largest, std::int32_t *length) {
  contents.clear();
  *length = 0;
  // A pipe without a writer must not be waited for.
  const int opened = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  struct stat facts{};
  const bool regular = opened >= 0 && fstat(opened, &facts) == 0 && S_ISREG(facts.st_mode);
  std::FILE *const file = regular ? fdopen(opened, "rb") : nullptr;
  if (file == nullptr) {
    if (opened >= 0)
      close(opened);
    return opened < 0 || S_ISDIR(facts.st_mode) ? 1 : 3;
  }
  char piece[65536];
  while (const std::size_t n = contents.size() > static_cast<std::size_t>(largest)
                                   ? 0
                                   : std::fread(piece, 1, sizeof piece, file))
    contents.append(piece, n);
  const bool failed = std::ferror(file) != 0;
  std::fclose(file);
  *length = static_cast<std::int32_t>(contents.size());
  return failed ? 2 : 0;
}

void bayesindent_take_bytes(char *bytes) {
  contents.copy(bytes, contents.size());
  contents = {};
}

// Writes `n` bytes to the disk as the file `beside`, and gives it the name `path`. After a failure
// there is no new file, and a reason, which is '' otherwise.
void bayesindent_write_file(const char *path, const char *beside, const char *bytes, std::int64_t n,
                            char *reason, std::int32_t size) {
  // A link with this name must not be followed.
  unlink(beside);
  const int opened = open(beside, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
  std::FILE *const file = opened < 0 ? nullptr : fdopen(opened, "wb");
  const bool whole = file != nullptr &&
                     std::fwrite(bytes, 1, n, file) == static_cast<std::size_t>(n) &&
                     std::fflush(file) == 0 && fsync(fileno(file)) == 0;
  int error = whole ? 0 : errno;
  if (file != nullptr && std::fclose(file) != 0 && error == 0)
    error = errno;
  if (error == 0 && std::rename(beside, path) != 0)
    error = errno;
  if (error != 0)
    unlink(beside);
  std::snprintf(reason, size, "%s", error == 0 ? "" : reason_of(error));
}

// Renames the file `beside` to `path` if it is complete and `path` does not exist; removes it
// otherwise.
void bayesindent_place_file(const char *beside, const char *path, bool whole) {
  // Some file systems have no links.
  if (whole && link(beside, path) != 0 && access(path, F_OK) != 0)
    std::rename(beside, path);
  unlink(beside);
}

// Creates a folder and its parents, if they are missing.
void bayesindent_make_folder(const char *path) {
  std::error_code failed;
  std::filesystem::create_directories(path, failed);
}

// Bytes that this process may still use, limited by the machine, its control group and its address
// space.
double bayesindent_free_memory() {
  constexpr double kilobyte = 1024.0;
  const double group = entry("/sys/fs/cgroup/memory.max", ""),
               space = entry("/proc/self/limits", "Max address space");
  double bytes = kilobyte * entry("/proc/meminfo", "MemAvailable:");
  if (std::isfinite(group))
    bytes = std::min(bytes, group - entry("/sys/fs/cgroup/memory.stat", "anon "));
  if (std::isfinite(space))
    bytes = std::min(bytes, space - kilobyte * entry("/proc/self/status", "VmSize:"));
  return std::max(bytes, 0.0);
}

// Lets OpenBLAS allocate its buffers for this number of callers at a time, before there are any;
// returns the number that it has buffers for. OpenBLAS would try for ever to allocate a missing
// one. A thread needs as much memory again for its own data.
std::int32_t bayesindent_reserve_blas(std::int32_t callers) {
  constexpr double bytes = 1.5e8;
  static std::mutex reserving;
  static std::int32_t reserved = 0;
  const std::lock_guard<std::mutex> guard(reserving);
  if (callers <= reserved || blas_memory_alloc == nullptr)
    return callers;
  std::vector<void *> buffers;
  for (std::int32_t i = 0;
       i < callers && (i < reserved || bayesindent_free_memory() > (i == 0 ? bytes : 2 * bytes));
       ++i)
    buffers.push_back(blas_memory_alloc(0));
  for (void *const buffer : buffers)
    blas_memory_free(buffer);
  return reserved = static_cast<std::int32_t>(buffers.size());
}

// Return free memory to the system, where that can be asked for.
void bayesindent_return_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

// The folder of the package's data, with a trailing slash: BAYESINDENT_DATA; or, relative to this
// program, the folder where meson installs it, that of a wheel, that of the build, or that of a
// Python.
void bayesindent_data_folder(const char *installed, char *folder, std::int32_t size) {
  const char *const stated = std::getenv("BAYESINDENT_DATA");
  std::string found = stated != nullptr && *stated != '\0' ? std::string(stated) + "/" : "";
  const char *const places[] = {installed, "../bayesindent/data/", "../data/",
                                "../python/bayesindent/data/"};
  for (const char *const place : places) {
    std::error_code failed;
    if (found.empty() && std::filesystem::is_directory(own_folder() / place, failed))
      found = (own_folder() / place).string();
  }
  std::snprintf(folder, size, "%s", found.empty() ? other_packages().c_str() : found.c_str());
}

// Writes a line to standard output (1) or error (2) at once. If standard output cannot be written,
// the program ends with status 1.
void bayesindent_print(std::int32_t to, const char *line) {
  if (dprintf(to, "%s\n", line) >= 0 || to != 1)
    return;
  dprintf(2, "standard output: cannot be written: %s\n", reason_of(errno));
  std::exit(1);
}

// Sets the vector kernels and the number of threads of OpenBLAS. OpenBLAS reads them before a
// program starts, so the program, in the version for this processor, is started once more. More
// than one thread would make the last bits of results depend on the number of cores. The user's own
// settings are respected.
void bayesindent_prepare_blas() {
  const std::string kernels = bayesindent_blas_kernels();
  const bool prepared = std::getenv("OPENBLAS_NUM_THREADS") != nullptr &&
                        (std::getenv("OPENBLAS_CORETYPE") != nullptr || kernels.empty());
  setenv("OPENBLAS_NUM_THREADS", "1", 0);
  if (!kernels.empty())
    setenv("OPENBLAS_CORETYPE", kernels.c_str(), 0);
  const char *const chosen = std::getenv("OPENBLAS_CORETYPE");
  if (chosen != nullptr && bayesindent_is_wide(chosen))
    restart((own_folder() / "../bayesindent/x86_64_v3/bayesindent-batch").string());
  if (!prepared)
    restart("/proc/self/exe");
}
}
