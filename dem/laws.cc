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
    throw std::runtime_error(fmt::format("was built for \"{}\", and this program is \"{}\". Build it again with the Acopla that runs it.",
                                         version(), laws_version));
  add(*this);
  libraries_.push_back(std::move(handle));
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

void Laws::remember(std::vector<LawInfo>& laws, LawInfo law) {
  if (!find(laws, law.name)) laws.push_back(std::move(law));
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
