#include "map/id_table.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "map/identifiers.h"

namespace parallax {
namespace {

struct Thing {
  PointId id;
  int value = 0;
};
using Table = IdTable<PointId, Thing>;

TEST(IdTable, GivesIdentifiersInOrderOfAgeAndWritesThemIntoTheValue) {
  Table t;
  EXPECT_TRUE(t.empty());
  for (int i = 0; i < 5; ++i) {
    const PointId next = t.next_id(3);
    const PointId id = t.insert({{}, 10 * i}, 3);
    EXPECT_EQ(id, next);
    EXPECT_EQ(id, (PointId{3, i}));
    EXPECT_EQ(t.at(id).id, id);
    EXPECT_EQ(t.at(id).value, 10 * i);
  }
  EXPECT_EQ(t.size(), 5);
  EXPECT_LT((PointId{3, 1}), (PointId{3, 2}));
  EXPECT_FALSE(PointId{}.valid());
}

TEST(IdTable, RemovalLeavesOthersAndNeverReusesAnIdentifier) {
  Table t;
  for (int i = 0; i < 4; ++i) t.insert({{}, i});
  EXPECT_TRUE(t.erase({0, 1}));
  EXPECT_TRUE(t.erase({0, 3}));
  EXPECT_FALSE(t.erase({0, 3}));
  EXPECT_EQ(t.size(), 2);
  EXPECT_EQ(t.capacity(), 4);
  EXPECT_EQ(t.find({0, 1}), nullptr);
  EXPECT_EQ(t.at({0, 2}).value, 2);
  EXPECT_EQ(t.insert({{}, 9}).index, 4);
}

TEST(IdTable, IterationSkipsHolesInOrder) {
  Table t;
  for (int i = 0; i < 6; ++i) t.insert({{}, i});
  for (int i : {0, 3, 5}) t.erase({0, i});
  std::vector<int> seen;
  for (const Thing& thing : static_cast<const Table&>(t)) seen.push_back(thing.value);
  EXPECT_EQ(seen, (std::vector<int>{1, 2, 4}));
  for (Thing& thing : t) thing.value += 100;
  EXPECT_EQ(t.at({0, 4}).value, 104);
  for (int i : {1, 2, 4}) t.erase({0, i});
  EXPECT_TRUE(t.begin() == t.end());
}

TEST(IdTable, CopiesAreOnTheirOwnAndMovesLeaveNothing) {
  Table t;
  for (int i = 0; i < 4; ++i) t.insert({{}, i});
  t.erase({0, 2});
  Table copy = t;
  copy.at({0, 1}).value = 77;
  copy.erase({0, 0});
  EXPECT_EQ(t.at({0, 1}).value, 1);
  EXPECT_TRUE(t.contains({0, 0}));
  EXPECT_FALSE(copy.contains({0, 2}));
  EXPECT_EQ(copy.insert({{}, 5}).index, 4) << "the hole is kept";
  t = copy;
  EXPECT_EQ(t.size(), 3);
  EXPECT_EQ(t.at({0, 1}).value, 77);
  const Table moved = std::move(t);
  EXPECT_EQ(moved.size(), 3);
  EXPECT_TRUE(t.empty());  // NOLINT: what a moved-from table is, is said
  EXPECT_EQ(t.capacity(), 0);
}

TEST(IdTable, UnknownIdentifiersAreSaidSo) {
  Table t;
  t.insert({{}, 1});
  EXPECT_FALSE(t.contains({0, -1}));
  EXPECT_FALSE(t.contains({0, 1}));
  EXPECT_EQ(t.find({0, 7}), nullptr);
  EXPECT_THROW(t.at({0, 7}), CheckFailure);
  EXPECT_THROW(static_cast<const Table&>(t).at({0, -1}), CheckFailure);
  t.clear();
  EXPECT_TRUE(t.empty());
  EXPECT_FALSE(t.contains({0, 0}));
}

}  // namespace
}  // namespace parallax
