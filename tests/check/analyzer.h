/* SPDX-License-Identifier: MIT */
/* This is for clang-tidy's analyzer alone, which reads one file at a time. The analyzer believes that a function of
 * another file may return anything, so each failure might return SH_OK. In this header it sees that these functions
 * always return the code of a failure.
 *
 * DEFINES_... says that the file under analysis defines the function. IN_SCENE says that the file is one of core/scene
 * or core/import. */
#ifndef TESTS_CHECK_ANALYZER_H
#define TESTS_CHECK_ANALYZER_H

#include "core/err.h"
#include "core/text.h"

#ifndef DEFINES_sh_fail
#define sh_fail(err, code, ...) ((void)(sh_fail)((err), (code), __VA_ARGS__), (code))
#endif
#ifndef DEFINES_sh_fail_stopped
#define sh_fail_stopped(err) ((void)(sh_fail_stopped)((err)), SH_ESTOPPED)
#endif
#ifndef DEFINES_text_fail
#define text_fail(t, line, code, err, ...) ((void)(text_fail)((t), (line), (code), (err), __VA_ARGS__), (code))
#endif

#ifdef IN_SCENE
#include "core/ply.h"
#include "core/scene/build_say.h"

#ifndef DEFINES_build_fail
#define build_fail(b, code, err, ...) ((void)(build_fail)((b), (code), (err), __VA_ARGS__), (code))
#endif
#ifndef DEFINES_ply_fail
#define ply_fail(rows, err, what) ((void)(ply_fail)((rows), (err), (what)), SH_EINPUT)
#endif
#endif

#endif
