// How long the games last: random input on random desks, with losses of tracking, a map that grows, is scaled and is
// made anew, settings that change, and games that are saved and go on from their save.
//
//   bench_game_endurance GAME|all [MINUTES [SEED [WALL_SECONDS]]]
//
// A row at every tenth of the way. It ends with 1 when anything was found:
// - a violation: numbers that are not finite or out of bounds, a score that falls, too many sounds or things to draw, a
//   save that is too long or does not come back to the same state;
// - a stuck state. Swarm and Marbles: ten minutes of play in which neither the score, the wave or level, nor the lives
//   change. Burning glass: before each new sheet, half a minute of the scripted player over the middle of the field has
//   to make it as hot as it must be to burn, and pressing undo has to take back every stroke;
// - growth: the resident set (freed memory given back) at the end is 5 percent and 2 MB more than at a tenth of the
// way. Nothing is shared between processes: several can run at once.
#include <malloc.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <random>
#include <string>

#include "games/game_runner.h"

using namespace parallax;

namespace {

constexpr double kFrame_s = 1.0 / 30;
constexpr double kBurningHeat = 2.0 / 3;  // of the gauge: hot enough to char
constexpr int kStuckTicks = 10 * 60 * kGameTicksPerSecond;
constexpr std::size_t kLongestSave = 2u << 20, kMostSounds = 80, kMostDrawn = 20'000;

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double part() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double between(double least, double most) { return least + (most - least) * part(); }
  bool once_in(double seconds) { return part() < kFrame_s / seconds; }  // asked every frame
  int index(int count) { return static_cast<int>(part() * count); }
  std::uint64_t next() { return engine_(); }

 private:
  std::mt19937_64 engine_;
};

double resident_mb() {
  malloc_trim(0);
  std::ifstream file("/proc/self/statm");
  double pages = 0, resident = 0;
  file >> pages >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1048576.0;
}

// A table of some size with things on it, that grows, is scaled and is another one.
class Desk {
 public:
  explicit Desk(Random* random) : random_(*random) { begin(); }
  const PlayingField& field() const { return field_; }

  void begin() {
    const int number = field_.number + 1;
    field_ = PlayingField();
    field_.number = number;
    field_.radius_m = 0.03 * std::pow(20, random_.part());
    const int corners = 3 + random_.index(12);
    for (int i = 0; i < corners; ++i) {
      const double angle = 2 * M_PI * (i + 0.7 * random_.part()) / corners;
      field_.outline_m.push_back(random_.between(0.8, 1.3) * field_.radius_m *
                                 Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    }
    field_.world_from_plane.R = Eigen::AngleAxisd(random_.between(-3, 3), Eigen::Vector3d::UnitZ()).toRotationMatrix();
    field_.world_from_plane.t = {random_.between(-1, 1), random_.between(-1, 1), random_.between(-1, 1)};
    look_again();
  }
  void grow() {
    const double factor = random_.between(1.03, 1.4);
    if (field_.radius_m * factor > 3 * field_.scale) return begin();  // a real table ends somewhere
    for (Eigen::Vector2d& corner : field_.outline_m) corner *= factor;
    field_.radius_m *= factor;
    look_again();
  }
  void scale() {
    const double factor = std::pow(4, random_.between(-1, 1));
    if (field_.radius_m * factor > 10 || field_.radius_m * factor < 0.005) return;
    for (Eigen::Vector2d& corner : field_.outline_m) corner *= factor;
    field_.radius_m *= factor;
    field_.scale *= factor;
    field_.surface.reset();  // of the old scale, as in the program
  }
  void look_again() {
    field_.surface.reset();
    if (random_.index(6) == 0) return;
    auto surface = std::make_shared<SceneSurface>();
    const double radius = field_.radius_m;
    surface->columns = 40 + random_.index(120);
    surface->rows = 40 + random_.index(120);
    surface->cell_m = 3 * radius / std::max(surface->columns, surface->rows);
    surface->corner_m = -0.5 * surface->cell_m * Eigen::Vector2d(surface->columns, surface->rows);
    const std::size_t cells = static_cast<std::size_t>(surface->columns) * static_cast<std::size_t>(surface->rows);
    surface->height_m.assign(cells, 0);
    surface->known.assign(cells, 1);
    for (int things = random_.index(9); things > 0; --things) {
      const Eigen::Vector2d at(random_.between(-radius, radius), random_.between(-radius, radius));
      const double turn = random_.between(0, 3), height = random_.between(0.01, 0.5) * radius;
      const double width = random_.between(0.02, 0.35) * radius, depth = random_.between(0.02, 0.35) * radius;
      for (std::size_t i = 0; i < cells; ++i) {
        const int row = static_cast<int>(i) / surface->columns, column = static_cast<int>(i) % surface->columns;
        const Eigen::Vector2d from = surface->centre_of(column, row) - at;
        const double x = from.x() * std::cos(turn) + from.y() * std::sin(turn);
        const double y = from.y() * std::cos(turn) - from.x() * std::sin(turn);
        if (std::abs(x) < width && std::abs(y) < depth) surface->height_m[i] = static_cast<float>(height);
      }
    }
    for (int k = random_.index(60); k > 0; --k)
      surface->height_m[random_.next() % cells] = static_cast<float>(random_.between(0, 0.3) * radius);
    for (int k = random_.index(200); k > 0; --k) surface->known[random_.next() % cells] = 0;
    field_.surface = std::move(surface);
  }

 private:
  Random& random_;
  PlayingField field_;
};

// From `height` radii above, and as far aside.
RigidTransform looking(const Eigen::Vector3d& eye, const Eigen::Vector3d& at) {
  const Eigen::Vector3d z = (at - eye).normalized();
  const Eigen::Vector3d x = z.cross(std::abs(z.y()) > 0.9 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY());
  Eigen::Matrix3d R;
  R.row(0) = x.normalized();
  R.row(1) = z.cross(x.normalized());
  R.row(2) = z;
  return {R, -R * eye};
}

struct Counts {
  std::int64_t ticks = 0, checks = 0, games = 0, over = 0, losses = 0, scalings = 0, growths = 0, saves = 0;
  std::int64_t stuck = 0, violations = 0;
};

class Trial {
 public:
  Trial(std::unique_ptr<Game> (*make)(), std::uint64_t seed)
      : make_(make), random_(seed), desk_(&random_), runner_(make()) {
    start();
  }
  const Counts& counts() const { return counts_; }

  void frame() {
    change_input();
    if (random_.once_in(12)) desk_.look_again(), tell_field();
    if (random_.once_in(25)) desk_.grow(), tell_field(), ++counts_.growths;
    if (random_.once_in(40)) desk_.scale(), tell_field(), ++counts_.scalings;
    if (random_.once_in(240)) desk_.begin(), tell_field();
    if (random_.once_in(20)) change_setting();
    if (random_.once_in(90)) runner_.toggle_pause();
    if (runner_.phase() == GamePhase::paused && random_.once_in(1)) runner_.toggle_pause();
    if (random_.once_in(30)) save_and_restore();
    const std::int64_t before = runner_.ticks();
    runner_.advance(random_.index(50) == 0 ? random_.between(0, 0.4) : kFrame_s, input_);
    const std::int64_t ticks = runner_.ticks() - before;
    counts_.ticks += ticks;
    since_progress_ += ticks;
    in_game_ += ticks;
    ++frames_;
    if (frames_ % 8 == 0) check();
    if (frames_ % 211 == 0) check_picture();
    if (runner_.phase() == GamePhase::over) ++counts_.over, start();
    if (in_game_ > most_minutes_ * 60 * kGameTicksPerSecond) {
      if (is_glass()) check_glass();
      start();
    }
  }

 private:
  bool is_glass() const { return runner_.game().info().name == "burning_glass"; }

  void start() {
    GameOptions options;
    options.seed = random_.next() >> 12;
    options.difficulty = static_cast<GameDifficulty>(random_.index(3));
    options.seated = random_.index(4) == 0;
    options.colour_blind_safe = random_.index(2) == 0;
    desk_.begin();
    runner_.start(desk_.field(), options);
    runner_.set_scripted(random_.index(4) == 0);
    ++counts_.games;
    since_progress_ = in_game_ = 0;
    last_score_ = 0;
    most_minutes_ = random_.between(2, 40);
  }

  void tell_field() { runner_.change_field(desk_.field()); }

  void found(const std::string& what, bool stuck = false) {
    ++(stuck ? counts_.stuck : counts_.violations);
    if (counts_.stuck + counts_.violations <= 20)
      std::printf("  FOUND %s: %s (seed of the game %llu, tick %lld, all ticks %lld)\n",
                  runner_.game().info().name.c_str(), what.c_str(),
                  static_cast<unsigned long long>(runner_.options().seed), static_cast<long long>(in_game_),
                  static_cast<long long>(counts_.ticks));
    std::fflush(stdout);
  }

  void change_input() {
    if (--held_ > 0) return;
    held_ = 1 + random_.index(30);
    input_.move = {random_.between(-1.2, 1.2), random_.between(-1.2, 1.2)};
    input_.dial = random_.between(-1.2, 1.2);
    input_.fire = random_.index(3) != 0;
    input_.act = random_.index(12) == 0;
    input_.camera_from_plane.reset();
    if (random_.index(40) == 0) {
      ++counts_.losses;
      return;
    }
    const double radius = desk_.field().radius_m;
    const Eigen::Vector3d at(random_.between(-radius, radius), random_.between(-radius, radius), 0);
    const Eigen::Vector3d eye = at + radius * Eigen::Vector3d(random_.between(-2, 2), random_.between(-2, 2),
                                                              random_.index(30) == 0 ? -0.1 : random_.between(0.2, 3));
    if ((eye - at).norm() > 1e-6) input_.camera_from_plane = looking(eye, at);
    if (random_.index(3000) == 0) input_.camera_from_plane->t.x() = std::nan("");
    if (random_.index(3000) == 0) input_.move.x() = std::nan("");
  }

  void change_setting() {
    const auto& settings = runner_.game().info().settings;
    if (settings.empty()) return;
    const GameSetting& one = settings[static_cast<std::size_t>(random_.index(static_cast<int>(settings.size())))];
    const double most = one.choices.empty() ? one.most : static_cast<double>(one.choices.size()) - 1;
    runner_.game().set(one.name, one.choices.empty() ? random_.between(one.least, most)
                                                     : random_.index(static_cast<int>(one.choices.size())));
  }

  void save_and_restore() {
    ++counts_.saves;
    const std::string text = runner_.game().save();
    if (text.size() > kLongestSave) found("a save of " + std::to_string(text.size()) + " bytes");
    const std::uint64_t hash = runner_.game().state_hash();
    try {
      const auto other = make_();
      other->restore(text, desk_.field());
      if (other->state_hash() != hash || other->save() != text) found("a save that comes back as something else");
      if (random_.index(2) == 0) {
        runner_.game().restore(text, desk_.field());
        runner_.resume(runner_.options());
      }
    } catch (const std::exception& error) {
      found(std::string("a save that is refused: ") + error.what());
    }
  }

  void check() {
    ++counts_.checks;
    const GameHud hud = runner_.game().hud();
    if (hud.score < last_score_ && !is_glass()) found("a score that falls");
    std::string marks = std::to_string(hud.score);
    if (!hud.lines.empty()) marks += hud.lines.front() + hud.lines.back();
    if (marks != progress_ || is_glass()) since_progress_ = 0;
    progress_ = std::move(marks);
    last_score_ = hud.score;
    if (since_progress_ > kStuckTicks) found("nothing happens any more", true), start();
    for (const GameGauge& gauge : hud.gauges)
      if (!(gauge.value >= 0 && gauge.value <= 1)) found("gauge " + gauge.label + " " + std::to_string(gauge.value));
    if (hud.lines.size() > 12 || hud.message.size() > 120) found("too many words");
    const auto sounds = runner_.take_sounds();
    if (sounds.size() > kMostSounds) found("too many sounds");
    for (const GameSound& sound : sounds)
      if (!std::isfinite(sound.volume) || !std::isfinite(sound.pitch) ||
          (sound.position_m && !sound.position_m->allFinite()))
        found("sound " + sound.name + " is nowhere");
    const GameInput scripted = runner_.game().scripted_input(input_.camera_from_plane);
    if (!scripted.move.allFinite() || !std::isfinite(scripted.dial)) found("a script without numbers");
  }

  void check_picture() {
    DrawList list;
    list.camera = CameraModel(CameraModelKind::pinhole, 640, 480, {500, 500}, {319.5, 239.5});
    runner_.game().draw(models_, &list);
    if (list.meshes.size() + list.sprites.size() + list.world_lines.size() > kMostDrawn) found("too much to draw");
    bool finite = true;
    for (const MeshInstance& mesh : list.meshes) finite &= mesh.world_from_model.matrix().allFinite();
    for (const Sprite& sprite : list.sprites) finite &= sprite.position.allFinite() && sprite.radius_m >= 0;
    for (const WorldLine& line : list.world_lines) finite &= line.a.allFinite() && line.b.allFinite();
    if (!finite) found("things drawn nowhere");
  }

  // The sheet can still be burnt, and all strokes undone.
  void check_glass() {
    Game& game = runner_.game();
    const auto strokes = [&] {
      for (const std::string& line : game.hud().lines)
        if (line.rfind("strokes ", 0) == 0) return std::atoi(line.c_str() + 8);
      return -1;
    };
    for (int press = 0; press < 70 && strokes() != 0; ++press)
      for (const bool down : {true, false}) {
        GameInput input;
        input.act = down;
        game.step(input);
      }
    if (strokes() != 0) found("strokes that cannot be undone", true);
    game.set("lens_diameter", 0.5);
    const double radius = desk_.field().radius_m;
    // From nearer where the field has grown round the sheet: the lens's focal length has its limits.
    double hottest = 0;
    std::string heights;
    for (double height = radius; height > 0.002 * radius && hottest < kBurningHeat; height /= 2) {
      const RigidTransform camera = looking({0, 0, height}, {0, 0, 0});
      for (int tick = 0; tick < 30 * kGameTicksPerSecond; ++tick) {
        game.step(game.scripted_input(camera));
        if (tick % 30 != 0) continue;
        for (const GameGauge& gauge : game.hud().gauges)
          if (gauge.label == "heat") hottest = std::max(hottest, gauge.value);
      }
      counts_.ticks += 30 * kGameTicksPerSecond;
      heights += " " + std::to_string(hottest);
    }
    if (hottest < kBurningHeat) found("light that does not burn:" + heights, true);
  }

  std::unique_ptr<Game> (*make_)();
  Random random_;
  Desk desk_;
  GameRunner runner_;
  ModelSet models_;
  GameInput input_;
  Counts counts_;
  std::string progress_;
  int held_ = 0;
  std::int64_t since_progress_ = 0, in_game_ = 0, frames_ = 0, last_score_ = 0;
  double most_minutes_ = 10;
};

// False when anything was found.
bool endure(const std::string& name, std::unique_ptr<Game> (*make)(), double minutes, std::uint64_t seed, double wall) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(Clock::now() - begin).count(); };
  Trial trial(make, seed);
  double tenth_mb = 0, end_mb = 0;
  bool ended = false;
  for (int tenth = 1; tenth <= 10 && !ended; ++tenth) {
    const double until = minutes * 60 * kGameTicksPerSecond * tenth / 10;
    for (std::int64_t frames = 0; static_cast<double>(trial.counts().ticks) < until && !ended; ++frames) {
      trial.frame();
      ended = frames % 1024 == 0 && seconds() > wall;
    }
    end_mb = resident_mb();
    if (tenth == 1) tenth_mb = end_mb;
    const Counts& c = trial.counts();
    std::printf("%-14s %9.1f %11lld %10lld %6lld %6lld %7lld %6lld %6lld %6lld %5lld %5lld %8.1f %8.1f %7.1f\n",
                name.c_str(), static_cast<double>(c.ticks) / (60.0 * kGameTicksPerSecond),
                static_cast<long long>(c.ticks), static_cast<long long>(c.checks), static_cast<long long>(c.games),
                static_cast<long long>(c.over), static_cast<long long>(c.losses), static_cast<long long>(c.scalings),
                static_cast<long long>(c.growths), static_cast<long long>(c.saves), static_cast<long long>(c.stuck),
                static_cast<long long>(c.violations), tenth_mb, end_mb,
                1e6 * seconds() / static_cast<double>(std::max<std::int64_t>(c.ticks, 1)));
    std::fflush(stdout);
  }
  const bool grew = end_mb > 1.05 * tenth_mb + 2;
  if (grew) std::printf("  FOUND %s: memory grew from %.1f to %.1f MB\n", name.c_str(), tenth_mb, end_mb);
  return !grew && trial.counts().stuck + trial.counts().violations == 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string wanted = argc > 1 ? argv[1] : "all";
  const double minutes = argc > 2 ? std::atof(argv[2]) : 10;
  const std::uint64_t seed = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
  const double wall = argc > 4 ? std::atof(argv[4]) : 1e9;
  std::printf("%-14s %9s %11s %10s %6s %6s %7s %6s %6s %6s %5s %5s %8s %8s %7s\n", "game", "minutes", "ticks", "checks",
              "games", "over", "losses", "scaled", "grown", "saves", "stuck", "wrong", "MB 10%", "MB now", "us/tick");
  bool clean = true, any = false;
  for (const auto& [name, make] : {std::pair{"swarm", &make_swarm}, std::pair{"burning_glass", &make_burning_glass},
                                   std::pair{"marbles", &make_marbles}}) {
    if (wanted != "all" && wanted != name) continue;
    any = true;
    clean = endure(name, make, minutes, seed, wall) && clean;
  }
  if (!any) std::fprintf(stderr, "found '%s', expected swarm, burning_glass, marbles or all\n", wanted.c_str());
  return any && clean ? 0 : any ? 1 : 2;
}
