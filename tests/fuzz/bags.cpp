// SPDX-License-Identifier: Apache-2.0
// ROS 1 bags. (Those of ROS 2 are databases, and SQLite's to read.)
#include "bags/bag.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace locus;
  using fuzz::demand;
  static const fuzz::MemoryFile kFile;
  const auto path = kFile.with(fuzz::text_of(data, size));
  if (!tools::looks_like_bag(path))
    return 0;
  const auto bag = tools::open_bag(path);
  if (!bag) {
    demand(bag.error().starts_with(path.string() + ": ") && bag.error().find('\n') == std::string::npos);
    return 0;
  }
  const auto count = [&bag] {
    (*bag)->rewind();
    std::size_t messages = 0;
    for (const tools::BagMessage* message = (*bag)->next(); message != nullptr; message = (*bag)->next(), ++messages)
      demand(message->topic < (*bag)->topics().size() && (*bag)->progress() <= 1.0);
    return messages;
  };
  const std::size_t at_first = count(), then = count(); // a topic may be told of only after its first messages
  demand(at_first <= then && then == count());
  return 0;
}
