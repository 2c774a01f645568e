#include "cli/mpi_command.h"

#include "io/case_table.h"

namespace acopla::cli {

int processes_of(const std::string& case_file, const std::string& participant) {
  return static_cast<int>(io::Table::from_file(case_file).table(participant).integer("processes", 1, 65536, 1));
}

void run_on_processes(Command& command, int processes, const std::string& case_file, const std::string& participant) {
  if (processes == 1) return;
  if (find_program("mpirun", "").empty())
    io::Table::from_file(case_file).table(participant).fail("processes", "needs mpirun, which is not installed. Install openmpi-bin, or remove the key.");
  // --quiet: the coupler tells what happened, with the participant's own words. More processes than cores are the user's choice, and then
  // nobody may be bound to one.
  std::vector<std::string> words{"mpirun", "--quiet", "--oversubscribe", "--bind-to", "none", "-np", std::to_string(processes)};
  words.insert(words.end(), command.words.begin(), command.words.end());
  command.words = std::move(words);
  for (const char* allow : {"OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"}) command.environment.emplace_back(allow, "1");
  command.environment.emplace_back("OMPI_MCA_mpi_yield_when_idle", "1");
  // When one dies mpirun ends the others, after a pause for them to tidy up that a death to be told within 2 s does not have.
  command.environment.emplace_back("OMPI_MCA_odls_base_sigkill_timeout", "0");
}

}  // namespace acopla::cli
