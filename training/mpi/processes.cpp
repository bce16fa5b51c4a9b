// SPDX-License-Identifier: Apache-2.0
// A word from each, and the first rank's judgement.
#include "training/mpi/processes.h"

#include <new>
#include <utility>
#include <vector>

#include "core/system/error.h"
#include "training/mpi/messages.h"

namespace tg {
namespace {

struct Failure {
  int code = 0;  // 0: none
  std::string text;
};

Failure failureOf(const std::exception_ptr& thrown) {
  if (!thrown) return {};
  try {
    std::rethrow_exception(thrown);
  } catch (const Error& error) {
    return {exitCode(error), error.what()};
  } catch (const std::bad_alloc&) {
    return {static_cast<int>(ErrorKind::device), "out of memory"};
  } catch (const std::exception& error) {
    return {static_cast<int>(ErrorKind::badData), error.what()};
  }
}

}  // namespace

Processes::Processes(std::unique_ptr<Channel> channel, const std::string& arguments) : channel_(std::move(channel)) {
  agree(nullptr, "version", TG_VERSION);
  agree(nullptr, "command line", arguments);
}

int Processes::fromFirst(int said) {
  MessageWriter writer;
  writer.put(said);
  const Message message = tg::fromFirst(*channel_, writer.take());
  return MessageReader(message).get<int>();
}

void Processes::agree(const std::exception_ptr& failed, const std::string& what, const std::string& text) {
  const Failure own = failureOf(failed);
  MessageWriter word;
  word.put(own.code);
  word.put(own.text);
  word.put(text);
  const std::vector<Message> words = toFirst(*channel_, word.take());
  Failure worst;
  for (std::size_t rank = 0; rank < words.size() && worst.code == 0; ++rank) {
    const std::string who = rank == 0 ? "" : "process " + std::to_string(rank) + ": ";
    MessageReader reader(words[rank]);
    const int code = reader.get<int>();
    const std::string failure = reader.getText();
    const std::string theirs = reader.getText();
    if (code != 0) {
      worst = {code, who + failure};
    } else if (own.code == 0 && theirs != text) {
      worst = {static_cast<int>(ErrorKind::usage), who + "has another " + what + expectedFound(text, theirs)};
    }
  }
  const int code = fromFirst(worst.code);
  if (code == 0) return;
  endTogether();
  if (!isFirst()) throw EndedByFirst(code);
  if (failed && worst.code == own.code && worst.text == own.text) std::rethrow_exception(failed);
  throw Error(static_cast<ErrorKind>(code), worst.text);
}

void Processes::leave(int code) {
  if (!together_) channel_->abort(code);
  channel_->finish();
}

}  // namespace tg
