// The combinations of laws that this program compiles, by normal and tangential law; each with every rolling law.
#pragma once

namespace acopla::dem {

class Laws;

void add_hertz(Laws& laws);
void add_hertz_mindlin(Laws& laws);
void add_linear(Laws& laws);
void add_linear_slider(Laws& laws);

}  // namespace acopla::dem
