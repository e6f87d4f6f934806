#pragma once

#include <cstdio>
#include <string>
#include <vector>

#include "offline/certify/task_result.h"

namespace tumbler {

/// Prints notes about a task on standard error, before it is worked on.
void PrintNotes(const Task& task);

/// Prints a motion, and on standard error a warning about a gradient that cannot be trusted.
/// @pre the result has a file.
void PrintMotion(std::FILE* people, const TaskResult& result);

/// The minima as a table of texts, best first; the first row names the columns.
std::vector<std::vector<std::string>> MinimaTable(const TaskResult& result);

/// Prints the table of minima.
void PrintMinima(std::FILE* people, const TaskResult& result);

/// Prints the table that ranks tasks, in this order.
void PrintRanking(std::FILE* people, const std::vector<const TaskResult*>& order);

}  // namespace tumbler
