#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Help, manual pages and completions of the programs, from the same option tables, the pages of docs/ beside them, and
the help of scripts: commands_test.py PROGRAM..."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

failures = []


def check(holds, what):
    if not holds:
        failures.append(what)


def run(*command, **more):
    environment = {key: value for key, value in os.environ.items() if key != "COLUMNS"} | more.pop("env", {})
    return subprocess.run([str(word) for word in command], env=environment, stdin=subprocess.DEVNULL,
                          capture_output=True, text=True, timeout=60, **more)


def options_of(help_text):
    """The long names that a help text lists."""
    return set(re.findall(r"^  (?:-\w, |    )(--[\w-]+)", help_text, re.M))


def examples_of(help_text):
    return re.findall(r"^  (\S.*)$", help_text.split("\nExamples:\n")[-1], re.M) if "\nExamples:\n" in help_text else []


def check_help(program, command):
    name = " ".join([program.name, *command])
    result = run(program, *command, "--help")
    text = result.stdout
    check(result.returncode == 0, f"{name} --help: exit code {result.returncode}")
    for line in text.splitlines():
        check(len(line) <= 80, f"{name} --help: longer than 80: {line}")
    narrow = run(program, *command, "--help", env={"COLUMNS": "60"}).stdout.split("\nExamples:\n")[0]
    for line in narrow.splitlines():
        check(len(line) <= 60 or " " not in line.strip(), f"{name} --help, 60 columns: longer: {line}")
    options = options_of(text)
    for wanted in ("--help", "--version", "--quiet"):
        check(wanted in options, f"{name} --help: no {wanted}")
    check(len(examples_of(text)) >= 5, f"{name} --help: {len(examples_of(text))} examples")
    check(run(program, *command, "--version").stdout.startswith(program.name + " "), f"{name} --version")
    return text, options


def check_examples(name, text, known):
    for example in examples_of(text):
        for part in re.split(r"&&|\|\||;|>", example):
            words = part.split()
            programs = [word for word in words if word in known]
            for word in words:
                if word.startswith("--") and programs:
                    command = words[words.index(programs[0]) + 1:][:1]
                    options = known[programs[0]].get(command[0] if command else "", known[programs[0]][""])
                    check(word in options, f"{name} --help: the example has {word}: {example}")


def completions(script, program, words, folder=None):
    """What bash offers for the last of the words."""
    lines = ["source " + script, f"COMP_WORDS=({' '.join(repr(word) for word in words)})",
             f"COMP_CWORD={len(words) - 1}", "compopt() { :; }", f"_{program.name} 2>&1", 'printf "%s\\n" "${COMPREPLY[@]}"']
    return run("bash", "--norc", "-c", "\n".join(lines), cwd=folder).stdout.split()


def check_first_words(script, program, commands, folder):
    """A command while the word may become one, else a file; both where nothing is typed yet."""
    if not commands:
        return
    for name in (commands[0] + "-file", "other"):
        (folder / name).touch()
    check(completions(script, program, [program.name, commands[0][:2]], folder)
          == [command for command in commands if command.startswith(commands[0][:2])], f"bash: {program.name}: a command")
    check(completions(script, program, [program.name, "oth"], folder) == [], f"bash: {program.name}: a file is bash's")
    check({*commands, "other"} <= set(completions(script, program, [program.name, ""], folder)), f"bash: {program.name}: all")


def check_zsh(program, folder):
    """The file works where it is sourced, and in $fpath, where its first call runs it."""
    source = folder / f"{program.name}.zsh"
    autoload = folder / f"fpath-{program.name}"
    autoload.mkdir()
    (autoload / f"_{program.name}").write_text(source.read_text())
    start = f"autoload -Uz compinit; compinit -u -D -d {folder}/dump-{program.name}; "
    sourced = run("zsh", "-f", "-c", start + f"source {source} && print -r -- $_comps[{program.name}] $+functions[_{program.name}]")
    check((sourced.stdout.split(), sourced.stderr) == ([f"_{program.name}", "1"], ""),
          f"zsh: source {source.name}: {sourced.stdout}{sourced.stderr}")
    found = run("zsh", "-f", "-c", f"fpath=({autoload} $fpath); " + start + "_arguments() { print -r -- called; }; "
                f"print -r -- $_comps[{program.name}]; words=({program.name} ''); CURRENT=2; _{program.name}")
    check((found.stdout.split(), found.stderr) == ([f"_{program.name}", "called"], ""),
          f"zsh: {program.name} in $fpath: {found.stdout}{found.stderr}")


def check_shells(program, folder, tables):
    for shell, flags in (("bash", ["-n"]), ("zsh", ["-n"]), ("fish", ["--no-execute"])):
        script = str(folder / f"{program.name}.{shell}")
        result = run(program, "--completion", shell)
        pathlib.Path(script).write_text(result.stdout)
        for command, options in tables.items():
            for option in options:
                named = option if shell != "fish" else "-l " + option[2:]
                check(re.search(re.escape(named) + r"(?![\w-])", result.stdout), f"{program.name} {command}: {shell}: {option}")
        if shutil.which(shell):
            checked = run(shell, *flags, script)
            check(checked.returncode == 0 and not checked.stderr, f"{script}: {checked.stderr}")
    script = str(folder / f"{program.name}.bash")
    for command, options in tables.items():
        before = [program.name, command] if command else [program.name]
        offered = completions(script, program, [*before, "--"])
        check(set(offered) >= options, f"bash offers {program.name} {command}: {sorted(options - set(offered))} are missing")
        check(completions(script, program, [*before, "--vers"]) == ["--version"], f"bash: {before} --vers")
    check_first_words(script, program, [command for command in tables if command], folder)
    if shutil.which("zsh"):
        check_zsh(program, folder)
    check(completions(script, program, [program.name, "--completion", "z"]) == ["zsh"], "bash: a value")
    check(completions(script, program, [program.name, "--completion", "=", "f"]) == ["fish"], "bash: a value after =")


def check_manual(program, folder, tables):
    page = folder / f"{program.name}.1"
    text = run(program, "--man").stdout
    page.write_text(text)
    for command, options in tables.items():
        for option in options:
            check(option.replace("-", "\\-") in text, f"{page.name}: {command} {option}")
    if shutil.which("mandoc"):
        result = run("mandoc", "-T", "lint", "-W", "warning", page)
        check(result.returncode == 0, f"{page.name}: {result.stdout}")
    elif shutil.which("man"):
        result = run("man", "--warnings", "-l", page)
        check(result.returncode == 0 and not result.stderr, f"{page.name}: {result.stderr}")


def check_docs(known):
    """Every option stands in a page of docs/, but for those that every program has."""
    docs = pathlib.Path(__file__).resolve().parents[1] / "docs"
    pages = "\n".join(page.read_text() for page in docs.glob("*.md"))
    for program, commands in known.items():
        for option in set().union(*commands.values()) - {"--help", "--version", "--man", "--completion"}:
            check(re.search(re.escape(option) + r"(?![\w-])", pages), f"docs/*.md: no {option} of {program}")


def check_scripts():
    """What a script is for is told without beginning it."""
    for script in sorted((pathlib.Path(__file__).resolve().parents[1] / "scripts").rglob("*.sh")):
        with tempfile.TemporaryDirectory() as folder:
            result = run(script, "--help", cwd=folder, env={"PATH": "/usr/bin:/bin", "HOME": folder})
        heading = re.search(r"^#!.*\n# (.*)$", script.read_text(), re.M)[1]
        check(result.returncode == 0 and result.stdout.startswith(heading),
              f"{script.name} --help: {result.stdout[:200]}")


def main():
    programs = [pathlib.Path(name) for name in sys.argv[1:]]
    known, texts = {}, {}
    for program in programs:
        text, options = check_help(program, [])
        known[program.name] = {"": options}
        texts[program.name] = text
        listed = text.split("\nCommands (each has --help):\n")
        commands = re.findall(r"^  ([\w-]+)", listed[1].split("\n\n")[0], re.M) if len(listed) > 1 else []
        for command in commands:
            texts[f"{program.name} {command}"], own = check_help(program, [command])
            known[program.name][command] = own - {"--completion", "--man"}  # of the program
            for asked in ("--man", "--man=1", "--completion=bash"):
                result = run(program, command, asked)
                check(result.returncode == 1 and "--completion and --man stand alone" in result.stderr,
                      f"{program.name} {command} {asked}: {result.stderr}")
            result = run(program, command[:-2] + command[-1] + command[-2], "x")
            check(result.returncode == 1 and f"did you mean {command}?" in result.stderr, f"{command}: {result.stderr}")
    for name, text in texts.items():
        check_examples(name, text, known)
    check_docs(known)
    check_scripts()
    with tempfile.TemporaryDirectory() as folder:
        for program in programs:
            tables = known[program.name]
            check_shells(program, pathlib.Path(folder), tables)
            check_manual(program, pathlib.Path(folder), tables)
            result = run(program, "x", "--overwirte" if "--overwrite" in tables[""] else "--rendre")
            check(result.returncode == 1 and result.stderr.count("\n") == 1 and "did you mean --" in result.stderr,
                  f"{program.name}: a slip: {result.stderr}")
            result = run(program, "x", "--completion", "bsh")
            check(result.returncode == 1 and "did you mean bash?" in result.stderr, f"{program.name}: a value: {result.stderr}")
    for failure in failures:
        print(failure)
    sys.exit(1 if failures else 0)


main()
