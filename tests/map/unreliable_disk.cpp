#include "tests/map/unreliable_disk.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace parallax::test {
namespace {

constexpr int kSector = 512;
constexpr int kMostName = 256;

struct Write {
  std::int64_t offset = 0;
  std::vector<std::uint8_t> bytes;
  std::int64_t truncate_to = -1;  // a truncation instead
};

void perform(const Write& write, std::vector<std::uint8_t>* bytes) {
  if (write.truncate_to >= 0) {
    bytes->resize(static_cast<std::size_t>(write.truncate_to));
    return;
  }
  const auto end = static_cast<std::size_t>(write.offset) + write.bytes.size();
  if (bytes->size() < end) bytes->resize(end);
  std::copy(write.bytes.begin(), write.bytes.end(), bytes->begin() + write.offset);
}

struct StoredFile {
  std::vector<std::uint8_t> seen, durable;
  std::vector<Write> pending;  // from durable to seen
  bool deleted = false;        // but the folder was not synchronised
};

}  // namespace

struct UnreliableDisk::State {
  sqlite3_vfs vfs{};
  std::string name;
  std::map<std::string, StoredFile> files;
  int operations = 0, full_from = -1, power_lost_at = -1;

  bool has_power() const { return power_lost_at < 0 || operations <= power_lost_at; }
  bool is_full() const { return full_from >= 0 && operations > full_from; }
  StoredFile* find(const std::string& path) {
    const auto it = files.find(path);
    return it == files.end() || it->second.deleted ? nullptr : &it->second;
  }
};

namespace {

struct OpenFile {
  sqlite3_file base;
  UnreliableDisk::State* disk;
  char path[kMostName];
};

StoredFile& stored(sqlite3_file* file) {
  auto* open = reinterpret_cast<OpenFile*>(file);
  return open->disk->files[open->path];
}

UnreliableDisk::State& disk(sqlite3_file* file) { return *reinterpret_cast<OpenFile*>(file)->disk; }

int close_file(sqlite3_file*) { return SQLITE_OK; }

int read_file(sqlite3_file* file, void* to, int amount, sqlite3_int64 offset) {
  const std::vector<std::uint8_t>& bytes = stored(file).seen;
  const auto begin = std::min<std::int64_t>(offset, static_cast<std::int64_t>(bytes.size()));
  const auto there = std::min<std::int64_t>(amount, static_cast<std::int64_t>(bytes.size()) - begin);
  if (there > 0) std::memcpy(to, bytes.data() + begin, static_cast<std::size_t>(there));
  if (there == amount) return SQLITE_OK;
  std::memset(static_cast<char*>(to) + there, 0, static_cast<std::size_t>(amount - there));
  return SQLITE_IOERR_SHORT_READ;
}

int write_file(sqlite3_file* file, const void* from, int amount, sqlite3_int64 offset) {
  ++disk(file).operations;
  if (!disk(file).has_power()) return SQLITE_IOERR_WRITE;
  if (disk(file).is_full()) return SQLITE_FULL;
  const auto* bytes = static_cast<const std::uint8_t*>(from);
  Write write{offset, {bytes, bytes + amount}, -1};
  perform(write, &stored(file).seen);
  stored(file).pending.push_back(std::move(write));
  return SQLITE_OK;
}

int truncate_file(sqlite3_file* file, sqlite3_int64 size) {
  ++disk(file).operations;
  if (!disk(file).has_power()) return SQLITE_IOERR_TRUNCATE;
  Write write{0, {}, size};
  perform(write, &stored(file).seen);
  stored(file).pending.push_back(std::move(write));
  return SQLITE_OK;
}

int sync_file(sqlite3_file* file, int) {
  ++disk(file).operations;
  if (!disk(file).has_power()) return SQLITE_IOERR_FSYNC;
  stored(file).durable = stored(file).seen;
  stored(file).pending.clear();
  return SQLITE_OK;
}

int size_of_file(sqlite3_file* file, sqlite3_int64* size) {
  *size = static_cast<sqlite3_int64>(stored(file).seen.size());
  return SQLITE_OK;
}

int lock_file(sqlite3_file*, int) { return SQLITE_OK; }
int reserved_lock(sqlite3_file*, int* result) {
  *result = 0;
  return SQLITE_OK;
}
int file_control(sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; }
int sector_size(sqlite3_file*) { return kSector; }
int characteristics(sqlite3_file*) { return 0; }

const sqlite3_io_methods kMethods = {
    1,         close_file, read_file,     write_file,   truncate_file, sync_file,       size_of_file,
    lock_file, lock_file,  reserved_lock, file_control, sector_size,   characteristics, nullptr,
    nullptr,   nullptr,    nullptr,       nullptr,      nullptr};

UnreliableDisk::State& disk_of(sqlite3_vfs* vfs) { return *static_cast<UnreliableDisk::State*>(vfs->pAppData); }

int open_file(sqlite3_vfs* vfs, const char* path, sqlite3_file* file, int flags, int* flags_out) {
  UnreliableDisk::State& state = disk_of(vfs);
  file->pMethods = nullptr;
  const std::string name = path ? path : "temporary";
  if (!state.find(name)) {
    if (!(flags & SQLITE_OPEN_CREATE)) return SQLITE_CANTOPEN;
    state.files[name] = StoredFile();
  }
  auto* open = reinterpret_cast<OpenFile*>(file);
  open->base.pMethods = &kMethods;
  open->disk = &state;
  sqlite3_snprintf(kMostName, open->path, "%s", name.c_str());
  if (flags_out) *flags_out = flags;
  return SQLITE_OK;
}

int delete_file(sqlite3_vfs* vfs, const char* path, int sync) {
  UnreliableDisk::State& state = disk_of(vfs);
  ++state.operations;
  if (!state.has_power()) return SQLITE_IOERR_DELETE;
  StoredFile* file = state.find(path);
  if (!file) return SQLITE_IOERR_DELETE_NOENT;
  if (sync)
    state.files.erase(path);
  else
    file->deleted = true;
  return SQLITE_OK;
}

int access_file(sqlite3_vfs* vfs, const char* path, int, int* result) {
  *result = disk_of(vfs).find(path) ? 1 : 0;
  return SQLITE_OK;
}

int full_path(sqlite3_vfs*, const char* path, int size, char* out) {
  sqlite3_snprintf(size, out, "%s", path);
  return SQLITE_OK;
}

int randomness(sqlite3_vfs*, int amount, char* out) {
  std::memset(out, 7, static_cast<std::size_t>(amount));
  return amount;
}
int sleep_for(sqlite3_vfs*, int microseconds) { return microseconds; }
int current_time(sqlite3_vfs*, double* days) {
  *days = 2460000.0;
  return SQLITE_OK;
}
int last_error(sqlite3_vfs*, int, char*) { return 0; }

}  // namespace

UnreliableDisk::UnreliableDisk() : state_(std::make_unique<State>()) {
  static int count = 0;
  state_->name = "unreliable-disk-" + std::to_string(++count);
  sqlite3_vfs& vfs = state_->vfs;
  vfs.iVersion = 1;
  vfs.szOsFile = sizeof(OpenFile);
  vfs.mxPathname = kMostName - 1;
  vfs.zName = state_->name.c_str();
  vfs.pAppData = state_.get();
  vfs.xOpen = open_file;
  vfs.xDelete = delete_file;
  vfs.xAccess = access_file;
  vfs.xFullPathname = full_path;
  vfs.xRandomness = randomness;
  vfs.xSleep = sleep_for;
  vfs.xCurrentTime = current_time;
  vfs.xGetLastError = last_error;
  sqlite3_vfs_register(&vfs, 0);
}

UnreliableDisk::~UnreliableDisk() { sqlite3_vfs_unregister(&state_->vfs); }

const std::string& UnreliableDisk::name() const { return state_->name; }
int UnreliableDisk::operations() const { return state_->operations; }
void UnreliableDisk::full_from(int operation) { state_->full_from = operation; }
void UnreliableDisk::power_lost_at(int operation) { state_->power_lost_at = operation; }

void UnreliableDisk::restore_power(std::mt19937_64* rng) {
  const auto coin = [rng] { return ((*rng)() & 1U) != 0; };
  for (auto it = state_->files.begin(); it != state_->files.end();) {
    StoredFile& file = it->second;
    // A name that went without its folder being synchronised may be back.
    if (file.deleted && coin()) {
      it = state_->files.erase(it);
      continue;
    }
    file.deleted = false;
    std::vector<std::uint8_t> bytes = file.durable;
    for (const Write& write : file.pending) {
      if (write.truncate_to >= 0) {
        if (coin()) perform(write, &bytes);
        continue;
      }
      for (std::size_t at = 0; at < write.bytes.size(); at += kSector) {
        if (!coin()) continue;
        const auto end = std::min(write.bytes.size(), at + kSector);
        perform({write.offset + static_cast<std::int64_t>(at),
                 {write.bytes.begin() + static_cast<std::ptrdiff_t>(at),
                  write.bytes.begin() + static_cast<std::ptrdiff_t>(end)},
                 -1},
                &bytes);
      }
    }
    file.seen = file.durable = std::move(bytes);
    file.pending.clear();
    ++it;
  }
  state_->power_lost_at = -1;
}

std::vector<std::uint8_t> UnreliableDisk::bytes(const std::string& path) const {
  const StoredFile* file = state_->find(path);
  return file ? file->seen : std::vector<std::uint8_t>();
}

}  // namespace parallax::test
