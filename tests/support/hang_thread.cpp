// SPDX-License-Identifier: Apache-2.0
// hang_thread PROCESS NAME: stops only the thread of that name until the process ends. Simulates a hanging thread
// without a hook in the service.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <sys/ptrace.h>
#include <sys/wait.h>

int main(int argc, char** argv) {
  if (argc != 3)
    return 2;
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::string(argv[1]) + "/task")) {
    std::string name;
    std::getline(std::ifstream(task.path() / "comm"), name);
    if (name != argv[2])
      continue;
    const pid_t thread = std::atoi(task.path().filename().c_str()); // NOLINT(cert-err34-c): the kernel wrote it
    if (ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) != 0 || ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) != 0)
      return std::perror("ptrace"), 1;
    int status = 0;
    while (waitpid(thread, &status, __WALL) == thread && !WIFEXITED(status) && !WIFSIGNALED(status)) {
    }
    return 0;
  }
  std::fprintf(stderr, "hang_thread: process %s has no thread %s\n", argv[1], argv[2]);
  return 1;
}
