// SPDX-License-Identifier: Apache-2.0
// Lengths first, then what is that long.
#include "training/mpi/messages.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "core/system/assert.h"

namespace tg {

std::vector<Message> exchangeMessages(Channel& channel, std::span<const std::span<const std::byte>> out) {
  const auto ranks = static_cast<std::size_t>(channel.size());
  TG_ASSERT(out.size() == ranks, "a message a rank");
  std::vector<std::uint64_t> sent(ranks), received(ranks);
  std::vector<std::span<const std::byte>> to(ranks);
  std::vector<std::span<std::byte>> from(ranks);
  for (std::size_t r = 0; r < ranks; ++r) {
    sent[r] = out[r].size();
    to[r] = std::as_bytes(std::span(&sent[r], 1));
    from[r] = std::as_writable_bytes(std::span(&received[r], 1));
  }
  channel.exchange(to, from);
  std::vector<Message> in(ranks);
  for (std::size_t r = 0; r < ranks; ++r) {
    in[r].resize(received[r]);
    from[r] = in[r];
  }
  channel.exchange(out, from);
  return in;
}

std::vector<Message> exchangeMessages(Channel& channel, std::vector<Message> out) {
  const auto rank = static_cast<std::size_t>(channel.rank());
  Message own = std::move(out[rank]);  // stays, without a copy
  out[rank] = {};
  std::vector<Message> in = exchangeMessages(channel, std::vector<std::span<const std::byte>>(out.begin(), out.end()));
  in[rank] = std::move(own);
  return in;
}

std::vector<Message> exchangeWithAll(Channel& channel, std::span<const std::byte> out) {
  return exchangeMessages(channel, std::vector(static_cast<std::size_t>(channel.size()), out));
}

Message fromFirst(Channel& channel, std::span<const std::byte> said) {
  std::vector<std::span<const std::byte>> out(static_cast<std::size_t>(channel.size()));
  if (channel.rank() == 0) std::ranges::fill(out, said);
  return std::move(exchangeMessages(channel, out).front());
}

std::vector<Message> toFirst(Channel& channel, std::span<const std::byte> said) {
  std::vector<std::span<const std::byte>> out(static_cast<std::size_t>(channel.size()));
  out.front() = said;
  std::vector<Message> in = exchangeMessages(channel, out);
  if (channel.rank() != 0) in.clear();
  return in;
}

}  // namespace tg
