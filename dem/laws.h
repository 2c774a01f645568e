// The laws that a case may name, and the kernels compiled for their combinations: the built-in ones and those of a user's libraries
// (docs/laws.md). What a library needs of it is inline: a library of laws leaves no symbol open to the program that loads it.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <string>
#include <typeinfo>
#include <vector>

#include "dem/contact/elastic_plastic.h"
#include "dem/kernels/kernel_of.h"

namespace acopla::dem {

/// What the case reader must know of a law.
struct LawInfo {
  std::string name;
  std::span<const Field> fields;  ///< its own numbers
  bool needs_moduli = false;      ///< elastic constants of the materials
  bool needs_friction = false;    ///< a tangential law below it (rolling laws)
  std::string type;               ///< of its struct: two laws of one name are one law only where this agrees
};

class Laws {
 public:
  /// The laws of this program.
  static Laws built_in();

  /// Compiles and names a combination, for discs and spheres.
  template <class Normal, class Tangential, class Rolling>
  void add() {
    using Model = ContactModel<Normal, Tangential, Rolling>;
    remember(normal_, {Normal::name, Normal::fields, Normal::needs_moduli, false, typeid(Normal).name()});
    remember(tangential_, {Tangential::name, Tangential::fields, Tangential::needs_moduli, false, typeid(Tangential).name()});
    remember(rolling_, {Rolling::name, Rolling::fields, false, needs_friction<Rolling>(), typeid(Rolling).name()});
    combinations_.push_back({{Normal::name, Tangential::name, Rolling::name},
                             Model::rotates,
                             [](const PairProperties& pair) -> std::unique_ptr<Kernel> { return std::make_unique<KernelOf<Model, 2>>(pair); },
                             [](const PairProperties& pair) -> std::unique_ptr<Kernel> { return std::make_unique<KernelOf<Model, 3>>(pair); }});
  }
  /// The same with every rolling law of this program.
  template <class Normal, class Tangential>
  void add_with_rolling() {
    add<Normal, Tangential, FreeRolling>();
    add<Normal, Tangential, ConstantTorque>();
    if constexpr (!std::is_same_v<Tangential, Frictionless>) add<Normal, Tangential, ElasticPlastic>();
  }

  /// Loads a library that adds its own laws; all of them or none. @throws std::runtime_error when it cannot be loaded, is not a library of
  /// laws, was built for another version, or names a law that is there already; the message continues "names X, which …"
  void load(const std::string& library);

  const LawInfo* normal(const std::string& name) const { return find(normal_, name); }
  const LawInfo* tangential(const std::string& name) const { return find(tangential_, name); }
  const LawInfo* rolling(const std::string& name) const { return find(rolling_, name); }
  std::vector<std::string> normals() const { return names(normal_); }
  std::vector<std::string> tangentials() const { return names(tangential_); }
  std::vector<std::string> rollings() const { return names(rolling_); }

  bool has(const LawSet& laws) const { return combination(laws) != nullptr; }
  /// Every combination that has a kernel.
  std::vector<LawSet> combinations() const;
  /// Tangential laws that go with a normal law.
  std::vector<std::string> tangentials_of(const std::string& normal) const;
  bool rotates(const LawSet& laws) const;
  /// @pre has(pair.laws)
  std::unique_ptr<Kernel> make(const PairProperties& pair, int dimension) const;

 private:
  struct Combination {
    LawSet laws;
    bool rotates;
    std::unique_ptr<Kernel> (*discs)(const PairProperties&);
    std::unique_ptr<Kernel> (*spheres)(const PairProperties&);
  };
  // A rolling law may say that its spring is built on the tangential law's.
  template <class Rolling>
  static constexpr bool needs_friction() {
    if constexpr (requires { Rolling::needs_friction; }) return Rolling::needs_friction;
    else return false;
  }
  static void remember(std::vector<LawInfo>& laws, LawInfo law) {
    const bool known = std::any_of(laws.begin(), laws.end(), [&](const LawInfo& one) { return one.name == law.name && one.type == law.type; });
    if (!known) laws.push_back(std::move(law));
  }
  static void merge(std::vector<LawInfo>& laws, const std::vector<LawInfo>& added);
  static const LawInfo* find(const std::vector<LawInfo>& laws, const std::string& name);
  static std::vector<std::string> names(const std::vector<LawInfo>& laws);
  const Combination* combination(const LawSet& laws) const;

  std::vector<LawInfo> normal_, tangential_, rolling_;
  std::vector<Combination> combinations_;
  std::vector<std::shared_ptr<void>> libraries_;  // open while a kernel of theirs may be called
};

/// What a library of laws was compiled against; a library of another one is refused. Kernels share arrays of packs with the engine, so the
/// width of a pack is part of it.
inline constexpr const char* laws_version = lanes == 8   ? "acopla laws 4, packs of eight"
                                            : lanes == 4 ? "acopla laws 4, packs of four"
                                                         : "acopla laws 4, packs of two";

}  // namespace acopla::dem

/// The entry of a user's library: ACOPLA_LAWS(laws) { laws.add_with_rolling<MyNormal, acopla::dem::LinearSlider>(); }
#define ACOPLA_LAWS(laws)                                                                                                           \
  extern "C" __attribute__((visibility("default"))) const char* acopla_laws_version() { return acopla::dem::laws_version; }          \
  extern "C" __attribute__((visibility("default"))) void acopla_add_laws(acopla::dem::Laws& laws)
