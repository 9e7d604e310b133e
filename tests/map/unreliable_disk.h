// A disk in memory for SQLite (a VFS) that gets full and loses power when told to. What was not synchronised when the
// power went is there in part: each write since, in sectors, or not.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace parallax::test {

class UnreliableDisk {
 public:
  // Registered with SQLite under name() as long as it lives.
  UnreliableDisk();
  ~UnreliableDisk();
  UnreliableDisk(const UnreliableDisk&) = delete;
  UnreliableDisk& operator=(const UnreliableDisk&) = delete;
  const std::string& name() const;

  // Writes, truncations, synchronisations and deletions so far.
  int operations() const;
  // The disk is full from the operation of this number on (negative: never). Truncating and deleting go on.
  void full_from(int operation);
  // The power goes at the operation of this number (negative: never): that and every later one fails.
  void power_lost_at(int operation);
  // The power comes back: what is on the disk is decided by the generator. Connections must have been closed.
  void restore_power(std::mt19937_64* rng);

  // The bytes of a file as programs see them; empty when there is none.
  std::vector<std::uint8_t> bytes(const std::string& path) const;

  struct State;

 private:
  std::unique_ptr<State> state_;
};

}  // namespace parallax::test
