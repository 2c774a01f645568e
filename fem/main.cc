#include "fem/program.h"

int main(int argc, char** argv) { return acopla::fem::run(argc, argv); }
