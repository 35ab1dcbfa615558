// SPDX-License-Identifier: Apache-2.0
#include "locus_experiments/conductor.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "locus_replay/progress_bar.hpp"

namespace locus::experiments {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

/// What the threads share.
class Board {
 public:
  explicit Board(const std::vector<Task>& tasks) {
    for (const Task& task : tasks) {
      (task.alone ? alone_ : parallel_).push_back(&task);
      expected_s_ += task.expected_s;
      for (const Task& next : task.then)
        expected_s_ += next.expected_s;
    }
  }

  /// The next task that may begin, waiting for one while what runs may still be followed by some; nullptr at the end.
  /// Those that must be alone go to the caller who asks when the others are over.
  const Task* begin(bool alone) {
    std::unique_lock lock(mutex_);
    std::deque<const Task*>& tasks = alone ? alone_ : parallel_;
    may_begin_.wait(lock, [&] { return !tasks.empty() || running_.empty(); });
    if (tasks.empty())
      return nullptr;
    const Task* const task = tasks.front();
    tasks.pop_front();
    running_.push_back({task, Clock::now()});
    return task;
  }
  void end(const Task* task) {
    const std::lock_guard lock(mutex_);
    std::erase_if(running_, [&](const Running& running) { return running.task == task; });
    done_s_ += task->expected_s;
    finished_.push_back(task->name);
    std::for_each(task->then.rbegin(), task->then.rend(),
                  [&](const Task& next) { (next.alone ? alone_ : parallel_).push_front(&next); });
    changed_.notify_one();
    may_begin_.notify_all();
  }
  void leave() {
    const std::lock_guard lock(mutex_);
    over_ = true;
    changed_.notify_one();
  }

  struct News {
    std::vector<std::string> finished; ///< since the last call
    double done = 0;                   ///< 0..1
    bool over = false;
  };
  News wait() {
    constexpr std::chrono::milliseconds kRedraw{200};
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kRedraw, [&] { return over_ || !finished_.empty(); });
    double done_s = done_s_;
    for (const Running& running : running_)
      done_s += std::min(seconds_since(running.begin), 0.9 * running.task->expected_s);
    return {std::exchange(finished_, {}), done_s / expected_s_, over_};
  }

 private:
  struct Running {
    const Task* task;
    Clock::time_point begin;
  };

  std::mutex mutex_;
  std::condition_variable changed_, may_begin_;
  std::deque<const Task*> parallel_, alone_;
  std::vector<Running> running_;
  std::vector<std::string> finished_;
  double done_s_ = 0, expected_s_ = 0;
  bool over_ = false;
};

void work(Board& board, bool alone) {
  while (const Task* const task = board.begin(alone)) {
    task->run();
    board.end(task);
  }
}

} // namespace

void conduct(const std::vector<Task>& tasks, int jobs, bool quiet) {
  if (tasks.empty())
    return;
  Board board(tasks);
  std::thread conductor([&] {
    {
      std::vector<std::jthread> workers;
      workers.reserve(static_cast<std::size_t>(jobs));
      for (int i = 0; i < jobs; ++i)
        workers.emplace_back([&] { work(board, false); });
    }
    work(board, true);
    board.leave();
  });
  tools::ProgressBar progress(!quiet);
  for (Board::News news; !news.over;) {
    news = board.wait();
    if (!news.finished.empty())
      progress.wipe();
    for (const std::string& name : news.finished) {
      if (!quiet)
        fmt::print("{}\n", name);
    }
    std::fflush(stdout);
    progress.show(news.done);
  }
  progress.wipe();
  conductor.join();
}

} // namespace locus::experiments
