#include "games/burning_glass_particles.h"

#include <algorithm>
#include <cmath>

namespace parallax::burning {
namespace {

constexpr std::size_t kMostSmoke = 90, kMostSparks = 60;
constexpr double kMostPerTick = 2;
constexpr float kRise = 0.16f, kDrift = 0.035f;  // radii a second
constexpr float kGravity = 2.2f;                 // radii a second squared

}  // namespace

void Particles::clear(std::uint64_t seed) {
  smoke_.clear();
  sparks_.clear();
  smoke_due_ = sparks_due_ = 0;
  generator_ = Generator(seed);
}

int Particles::advance(const Sheet& sheet, const Material& material, double dt_s) {
  const float dt = static_cast<float>(dt_s);
  for (Particle& puff : smoke_) {
    puff.age_s += dt;
    puff.position += dt * puff.velocity;
    puff.velocity.head<2>() *= 1 - 0.5f * dt;
  }
  for (Particle& spark : sparks_) {
    spark.age_s += dt;
    spark.velocity.z() -= kGravity * dt;
    spark.position += dt * spark.velocity;
    if (spark.position.z() < 0) {
      spark.position.z() = -spark.position.z();
      spark.velocity *= 0.4f;
      spark.velocity.z() = std::abs(spark.velocity.z());
    }
  }
  const auto is_over = [](const Particle& particle) { return particle.age_s >= particle.life_s; };
  std::erase_if(smoke_, is_over);
  std::erase_if(sparks_, is_over);

  const Sheet::Step& step = sheet.last();
  if (step.fresh.empty()) {
    smoke_due_ = sparks_due_ = 0;
    return 0;
  }
  const bool disc = material.kind == MaterialKind::compact_disc;
  smoke_due_ += std::min(material.smoke * step.charred, kMostPerTick);
  sparks_due_ += std::min(material.sparks * step.charred, kMostPerTick);
  const auto somewhere = [&] {
    const int cell = step.fresh[static_cast<std::size_t>(generator_.next() % step.fresh.size())];
    const auto place = [](int index) { return (static_cast<float>(index) + 0.5f) * 2 / kSheetCells - 1; };
    return Eigen::Vector3f(place(cell % kSheetCells), place(cell / kSheetCells), 0.005f);
  };
  const auto between = [&](double least, double most) { return static_cast<float>(generator_.uniform(least, most)); };
  for (; smoke_due_ >= 1; smoke_due_ -= 1) {
    if (smoke_.size() >= kMostSmoke) continue;
    Particle puff;
    puff.position = somewhere();
    puff.velocity = {between(-kDrift, kDrift), between(-kDrift, kDrift), kRise * between(0.7, 1.3)};
    puff.life_s = between(1.2, 2.4);
    puff.size = between(0.012, 0.022);
    puff.shade = disc ? between(0.75, 0.9) : between(0.45, 0.72);
    smoke_.push_back(puff);
  }
  int new_sparks = 0;
  for (; sparks_due_ >= 1; sparks_due_ -= 1) {
    if (sparks_.size() >= kMostSparks) continue;
    Particle spark;
    spark.position = somewhere();
    const float angle = between(0, 6.2831853), speed = between(0.08, 0.35);
    spark.velocity = {speed * std::cos(angle), speed * std::sin(angle), between(0.3, 0.75)};
    spark.life_s = between(0.25, 0.6);
    spark.size = between(0.004, 0.008);
    spark.shade = between(0, 1);
    sparks_.push_back(spark);
    ++new_sparks;
  }
  return new_sparks;
}

void Particles::draw(const Eigen::Affine3f& world_from_plane, double radius_m, DrawList* out) const {
  const float radius = static_cast<float>(radius_m);
  for (const Particle& puff : smoke_) {
    const float part = puff.age_s / puff.life_s;
    Sprite sprite;
    sprite.position = world_from_plane * Eigen::Vector3f(radius * puff.position);
    sprite.radius_m = radius * puff.size * (1 + 3.5f * part);
    const float fade = std::min(1.0f, 8 * part) * (1 - part);
    sprite.colour = {puff.shade, puff.shade, puff.shade * 1.02f, 0.34f * fade};
    out->sprites.push_back(sprite);
  }
  for (const Particle& spark : sparks_) {
    const float left = 1 - spark.age_s / spark.life_s;
    Sprite sprite;
    sprite.position = world_from_plane * Eigen::Vector3f(radius * spark.position);
    sprite.radius_m = radius * spark.size;
    sprite.additive = true;
    sprite.colour = {1, 0.45f + 0.45f * left, 0.1f + 0.5f * left * spark.shade, left};
    out->sprites.push_back(sprite);
  }
}

}  // namespace parallax::burning
