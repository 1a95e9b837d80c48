" G-code as LinuxCNC and Fanuc-like controls read it: spaces are allowed inside words, case does not matter.
if exists("b:current_syntax")
  finish
endif
syn case ignore
syn match gcodeNumber /[-+]\=\s*\%(\d[ \t0-9]*\.\=[0-9]*\|\.\d\+\)/ contained
syn match gcodeWord /[A-Z@^$]\s*[-+]\=\s*\%(\d\|\.\d\)[0-9.]*/ contains=gcodeAddress
syn match gcodeAddress /[A-Z@^$]/ contained
syn match gcodeMotion /G\s*0*\d\+\%(\.\d\+\)\=/
syn match gcodeMachine /[MT]\s*\d\+\%(\.\d\+\)\=/
syn match gcodeLine /\%(^\|\s\)N\s*\d\+/
syn match gcodeParameter /#\+\%(<[^>]*>\|\d\+\)/
syn match gcodeFunction /\<\%(abs\|acos\|asin\|atan\|cos\|exists\|exp\|fix\|fup\|ln\|round\|sin\|sqrt\|tan\)\ze\s*\[/
syn match gcodeOperator /\<\%(and\|or\|xor\|mod\|eq\|ne\|gt\|ge\|lt\|le\)\>/
syn match gcodeFlow /O\s*\%(<[^>]*>\|\d\+\)\s*\%(endsub\|sub\|call\|do\|while\|endwhile\|if\|elseif\|else\|endif\|break\|continue\|return\|repeat\|endrepeat\)\>/
syn match gcodeFlow /\<\%(goto\|then\|if\|while\|do\|end\)\s*\ze[\[0-9]/
syn match gcodeProgram /^\s*[O:]\d\+/
syn match gcodeDelete "^\s*/\d\="
syn match gcodePercent /^%.*/
syn region gcodeComment start=/(/ end=/)\|$/ contains=gcodeActive
syn match gcodeComment /;.*/
syn match gcodeActive /(\s*\%(MSG\|DEBUG\|PRINT\|LOG\|LOGOPEN\|LOGAPPEND\|LOGCLOSE\|PROBEOPEN\|PROBECLOSE\)\>/hs=s+1 contained
hi def link gcodeNumber Number
hi def link gcodeWord Number
hi def link gcodeAddress Type
hi def link gcodeMotion Statement
hi def link gcodeMachine Special
hi def link gcodeLine Label
hi def link gcodeProgram Label
hi def link gcodeParameter Identifier
hi def link gcodeFunction Function
hi def link gcodeOperator Operator
hi def link gcodeFlow Conditional
hi def link gcodeDelete PreProc
hi def link gcodePercent PreProc
hi def link gcodeComment Comment
hi def link gcodeActive SpecialComment
let b:current_syntax = "gcode"
