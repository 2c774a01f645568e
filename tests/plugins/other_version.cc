// As a library built with another Acopla looks.
extern "C" __attribute__((visibility("default"))) const char* acopla_laws_version() { return "acopla laws 1, packs of four"; }
extern "C" __attribute__((visibility("default"))) void acopla_add_laws(void*) {}
