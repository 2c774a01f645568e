#include "dem/laws.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "dem/kernels/built_in.h"

namespace acopla::dem {

Laws Laws::built_in() {
  Laws laws;
  add_hertz(laws);
  add_hertz_mindlin(laws);
  add_linear(laws);
  add_linear_slider(laws);
  return laws;
}

void Laws::load(const std::string& library) {
  dlerror();
  std::shared_ptr<void> handle(dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL), [](void* open) {
    if (open) dlclose(open);
  });
  if (!handle) throw std::runtime_error(fmt::format("cannot be loaded: {}", dlerror()));
  const auto version = reinterpret_cast<const char* (*)()>(dlsym(handle.get(), "acopla_laws_version"));
  const auto add = reinterpret_cast<void (*)(Laws&)>(dlsym(handle.get(), "acopla_add_laws"));
  if (!version || !add)
    throw std::runtime_error("is not a library of contact laws: it does not define ACOPLA_LAWS (see docs/laws.md)");
  if (std::string(version()) != laws_version)
    throw std::runtime_error(fmt::format("was built for \"{}\", and this program is of \"{}\". Build it again with the Acopla that runs it.",
                                         version(), laws_version));
  // Into a table of its own first: a library that fails leaves nothing behind.
  Laws added;
  add(added);
  if (added.combinations_.empty()) throw std::runtime_error("adds no laws: its ACOPLA_LAWS calls neither add nor add_with_rolling (see docs/laws.md)");
  auto all = *this;
  merge(all.normal_, added.normal_);
  merge(all.tangential_, added.tangential_);
  merge(all.rolling_, added.rolling_);
  for (const auto& combination : added.combinations_) {
    if (all.combination(combination.laws))
      throw std::runtime_error(fmt::format("adds the combination {}, which is there already. Remove it from its ACOPLA_LAWS.", combination.laws.text()));
    all.combinations_.push_back(combination);
  }
  all.libraries_.push_back(std::move(handle));
  *this = std::move(all);
}

std::vector<LawSet> Laws::combinations() const {
  std::vector<LawSet> all;
  for (const auto& combination : combinations_) all.push_back(combination.laws);
  return all;
}

std::vector<std::string> Laws::tangentials_of(const std::string& normal) const {
  std::vector<std::string> found;
  for (const auto& combination : combinations_)
    if (combination.laws.normal == normal && std::find(found.begin(), found.end(), combination.laws.tangential) == found.end())
      found.push_back(combination.laws.tangential);
  return found;
}

bool Laws::rotates(const LawSet& laws) const {
  const auto* found = combination(laws);
  return found && found->rotates;
}

std::unique_ptr<Kernel> Laws::make(const PairProperties& pair, int dimension) const {
  const auto* found = combination(pair.laws);
  if (!found) throw std::logic_error("no kernel for the laws " + pair.laws.text());
  return (dimension == 2 ? found->discs : found->spheres)(pair);
}

// A library may use laws that are there, as it has compiled them too, but not give their names to others.
void Laws::merge(std::vector<LawInfo>& laws, const std::vector<LawInfo>& added) {
  for (const auto& law : added) {
    const auto* known = find(laws, law.name);
    if (known && known->type != law.type)
      throw std::runtime_error(fmt::format("adds the law {}, and the law {} is there already. Give it another name.", law.name, law.name));
    if (!known) laws.push_back(law);
  }
}

const LawInfo* Laws::find(const std::vector<LawInfo>& laws, const std::string& name) {
  const auto found = std::find_if(laws.begin(), laws.end(), [&](const LawInfo& law) { return law.name == name; });
  return found == laws.end() ? nullptr : &*found;
}

std::vector<std::string> Laws::names(const std::vector<LawInfo>& laws) {
  std::vector<std::string> all;
  for (const auto& law : laws) all.push_back(law.name);
  return all;
}

const Laws::Combination* Laws::combination(const LawSet& laws) const {
  const auto found = std::find_if(combinations_.begin(), combinations_.end(), [&](const Combination& c) { return c.laws == laws; });
  return found == combinations_.end() ? nullptr : &*found;
}

}  // namespace acopla::dem
