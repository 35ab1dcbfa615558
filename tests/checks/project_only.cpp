// SPDX-License-Identifier: Apache-2.0
// A clang-tidy plugin that limits its checks to the project. Declarations of system headers are nine tenths of a unit,
// and clang-tidy traverses them without reporting anything; versions from 22 on skip them.
#include <vector>

#include <clang-tidy/ClangTidyCheck.h>
#include <clang-tidy/ClangTidyModule.h>
#include <clang-tidy/ClangTidyModuleRegistry.h>
#include <clang/AST/ASTContext.h>

namespace {

using namespace clang;

/// Restricts the traversal when the translation unit, the first node, is matched.
class ProjectOnly : public tidy::ClangTidyCheck {
 public:
  using ClangTidyCheck::ClangTidyCheck;

  void registerMatchers(ast_matchers::MatchFinder* finder) override {
    finder->addMatcher(ast_matchers::translationUnitDecl().bind("unit"), this);
  }

  void check(const ast_matchers::MatchFinder::MatchResult& result) override {
    std::vector<Decl*> ours;
    for (Decl* const each : result.Context->getTranslationUnitDecl()->decls())
      if (!result.SourceManager->isInSystemHeader(each->getLocation()))
        ours.push_back(each);
    result.Context->setTraversalScope(ours);
  }
};

class Module : public tidy::ClangTidyModule {
 public:
  void addCheckFactories(tidy::ClangTidyCheckFactories& factories) override {
    factories.registerCheck<ProjectOnly>("locus-project-only");
  }
};

const tidy::ClangTidyModuleRegistry::Add<Module> added("locus", "Checks of the project alone");

} // namespace
