#include "fem/program.h"

int main(int argc, char** argv) {
  return acopla::protocol::run_program(argc, argv, acopla::fem::program());
}
